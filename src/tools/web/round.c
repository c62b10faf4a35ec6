/* SPDX-License-Identifier: Apache-2.0 */
#include "web/round.h"
#include "client/clock.h"
#include "commission/round.h"
#include "web/grip.h"
#include "web/tokens.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#define ANSWER_MAX 64

struct told {
	struct told *next;
	const char *event;
	char *json;
};

struct db_web_round {
	pthread_t thread;
	pthread_mutex_t mutex;
	int out;  /* to the loop: there are texts */
	int wake; /* to the thread: an answer, or the end */
	char *socket;
	char *user;
	char *drive;
	struct db_web_round_order order;
	char hold_token[DB_WEB_TOKEN_MAX]; /* the thread's own copy */
	char said[ANSWER_MAX];             /* also the thread's own copy, of an answer */
	/* Under the mutex. */
	struct told *first;
	struct told **last;
	bool ends;
	bool late; /* a motion ended because it was not held */
	bool over;
	uint64_t question;   /* the number of the latest */
	const char *choices; /* of that question, NULL: it is answered */
	char answer[ANSWER_MAX];
	uint64_t motion; /* the number of the latest */
	bool moves;
	db_time held; /* when it was last held; 0: not yet */
	char token[DB_WEB_TOKEN_MAX];
};

static void signal_fd(int fd)
{
	const uint64_t one = 1;

	(void)!write(fd, &one, sizeof(one));
}

/* --- in the thread ---------------------------------------------------------------------------- */

/* Takes `data` over. Without memory for it the round ends: nobody would see its question. */
static void tell(struct db_web_round *round, const char *event, json_t *data)
{
	struct told *told = calloc(1, sizeof(*told));
	char *json = data ? json_dumps(data, JSON_COMPACT) : NULL;

	json_decref(data);
	(void)pthread_mutex_lock(&round->mutex);
	if (told && json) {
		*told = (struct told){ .event = event, .json = json };
		*round->last = told;
		round->last = &told->next;
	} else {
		round->ends = true;
		free(told);
		free(json);
	}
	(void)pthread_mutex_unlock(&round->mutex);
	signal_fd(round->out);
}

static bool hear(void *data)
{
	struct db_web_round *round = data;
	uint64_t count;
	bool ends;

	(void)!read(round->wake, &count, sizeof(count));
	(void)pthread_mutex_lock(&round->mutex);
	ends = round->ends;
	(void)pthread_mutex_unlock(&round->mutex);
	return !ends;
}

static const char *ask(void *data, struct db_commission_act *act,
                       const struct db_commission_action *question)
{
	struct db_web_round *round = data;
	/* A list of "yes no"; null: a number. */
	json_t *choices = question->choices[0] ? json_array() : json_null();
	uint64_t number;
	bool waits = true;

	for (const char *at = question->choices; *at;) {
		size_t word = strcspn(at, " ");

		(void)json_array_append_new(choices, json_stringn(at, word));
		at += word + strspn(at + word, " ");
	}
	(void)pthread_mutex_lock(&round->mutex);
	number = ++round->question;
	round->choices = question->choices;
	(void)pthread_mutex_unlock(&round->mutex);
	tell(round, "ask",
	     json_pack("{s:I, s:s, s:s, s:o}", "question", (json_int_t)number, "id", question->id,
	               "text", question->text, "choices", choices));
	while (waits && !act->interrupted) {
		(void)db_commission_act_wait(act, -1, 1000);
		(void)pthread_mutex_lock(&round->mutex);
		waits = round->choices != NULL;
		snprintf(round->said, sizeof(round->said), "%s", round->answer);
		(void)pthread_mutex_unlock(&round->mutex);
	}
	return waits || round->said[0] == '\0' ? NULL : round->said;
}

static void report_step(void *data, const struct db_commission_step *step)
{
	tell(data, "step",
	     json_pack("{s:s, s:s}", "step", step->name, "description", step->description));
}

static bool report_verdicts(void *data, const struct db_commission_step *step, json_t *verdicts,
                            json_t *done)
{
	json_t *mine = json_array();
	size_t i;
	json_t *verdict;

	(void)done;
	json_array_foreach(verdicts, i, verdict)
	{
		const char *of = json_string_value(json_object_get(verdict, "step"));

		if (of && strcmp(of, step->name) == 0)
			(void)json_array_append(mine, verdict);
	}
	tell(data, "verdicts", json_pack("{s:s, s:o}", "step", step->name, "verdicts", mine));
	return true;
}

static void report_motion(void *data, bool moving, bool again)
{
	struct db_web_round *round = data;
	json_int_t motion;

	(void)pthread_mutex_lock(&round->mutex);
	if (moving)
		round->motion++;
	round->moves = moving;
	round->held = 0;
	motion = (json_int_t)round->motion;
	(void)pthread_mutex_unlock(&round->mutex);
	tell(round, moving ? "moving" : "stood",
	     json_pack("{s:I, s:b}", "motion", motion, "again", again));
}

/* The browser's token holds the motion: so the service also notices when the browser is not there
 * any more. */
static const char *hold(void *data, const char *own)
{
	struct db_web_round *round = data;
	bool held;

	(void)own;
	(void)pthread_mutex_lock(&round->mutex);
	held = !round->ends && round->held != 0 && db_client_now() - round->held < DB_WEB_GRIP_LATE;
	round->late = round->late || (!held && !round->ends && round->held != 0);
	snprintf(round->hold_token, sizeof(round->hold_token), "%s", round->token);
	(void)pthread_mutex_unlock(&round->mutex);
	return held ? round->hold_token : NULL;
}

static void *run(void *context)
{
	struct db_web_round *round = context;
	const struct db_commission_order order = {
		.socket = round->socket,
		.user = round->user,
		.drive = round->drive,
		.velocity = round->order.velocity,
		.seconds = round->order.seconds,
	};
	const struct db_commission_asker asker = {
		.data = round,
		.fd = round->wake,
		.hear = hear,
		.ask = ask,
		.begin = report_step,
		.end = report_verdicts,
		.moves = report_motion,
		.hold = hold,
	};
	struct db_client_error error = { .parameters = NULL };
	struct db_commission_round work;
	struct db_commission_report report;
	char *sections;
	char *text;

	if (db_commission_round_open(&work, &order, &asker, &error) == 0) {
		db_commission_round_run(&work, round->order.only);
		report = db_commission_round_report(&work);
		sections = db_commission_report_copy(&report, db_commission_report_sections);
		text = db_commission_report_copy(&report, db_commission_report_write);
		tell(round, "result",
		     json_pack("{s:s, s:b, s:b, s:b, s:O, s:O, s:s, s:s}", "drive", report.drive,
		               "interrupted", work.act.interrupted, "late",
		               db_web_round_is_late(round), "lost", work.act.lost, "done",
		               work.done, "verdicts", work.engine.verdicts, "sections",
		               sections ? sections : "", "report", text ? text : ""));
		free(sections);
		free(text);
	} else {
		tell(round, "failed",
		     json_pack("{s:s, s:s}", "error", error.name, "text", error.text));
	}
	db_client_error_clear(&error);
	db_commission_round_close(&work);
	(void)pthread_mutex_lock(&round->mutex);
	round->over = true;
	(void)pthread_mutex_unlock(&round->mutex);
	signal_fd(round->out);
	return NULL;
}

/* --- in the loop ------------------------------------------------------------------------------ */

static void dispose(struct db_web_round *round)
{
	while (round->first) {
		struct told *told = round->first;

		round->first = told->next;
		free(told->json);
		free(told);
	}
	if (round->out >= 0)
		(void)close(round->out);
	if (round->wake >= 0)
		(void)close(round->wake);
	(void)pthread_mutex_destroy(&round->mutex);
	free(round->socket);
	free(round->user);
	free(round->drive);
	free(round);
}

struct db_web_round *db_web_round_new(const struct db_web_round_order *order)
{
	struct db_web_round *round = calloc(1, sizeof(*round));

	if (!round)
		return NULL;
	(void)pthread_mutex_init(&round->mutex, NULL);
	round->last = &round->first;
	round->out = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
	round->wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
	round->order = *order;
	round->socket = strdup(order->socket);
	round->user = strdup(order->user);
	round->drive = strdup(order->drive);
	if (round->out >= 0 && round->wake >= 0 && round->socket && round->user && round->drive &&
	    pthread_create(&round->thread, NULL, run, round) == 0)
		return round;
	dispose(round);
	return NULL;
}

void db_web_round_free(struct db_web_round *round)
{
	if (!round)
		return;
	db_web_round_end(round);
	(void)pthread_join(round->thread, NULL);
	dispose(round);
}

int db_web_round_fd(const struct db_web_round *round)
{
	return round->out;
}

bool db_web_round_take(struct db_web_round *round, const char **event, char **json, bool *over)
{
	struct told *told;
	uint64_t count;

	(void)!read(round->out, &count, sizeof(count));
	(void)pthread_mutex_lock(&round->mutex);
	told = round->first;
	if (told) {
		round->first = told->next;
		if (!round->first)
			round->last = &round->first;
	}
	*over = !told && round->over;
	(void)pthread_mutex_unlock(&round->mutex);
	if (!told)
		return false;
	*event = told->event;
	*json = told->json;
	free(told);
	return true;
}

bool db_web_round_is_late(struct db_web_round *round)
{
	bool late;

	(void)pthread_mutex_lock(&round->mutex);
	late = round->late;
	(void)pthread_mutex_unlock(&round->mutex);
	return late;
}

bool db_web_round_answer(struct db_web_round *round, uint64_t question, const char *answer)
{
	bool skips = answer[0] == '\0' || strcmp(answer, "skip") == 0;
	bool taken;

	(void)pthread_mutex_lock(&round->mutex);
	taken = question == round->question && round->choices &&
	        (skips || db_commission_choose(round->choices, answer, round->answer,
	                                       sizeof(round->answer)));
	if (taken) {
		round->choices = NULL;
		if (skips)
			round->answer[0] = '\0';
	}
	(void)pthread_mutex_unlock(&round->mutex);
	if (taken)
		signal_fd(round->wake);
	return taken;
}

void db_web_round_hold(struct db_web_round *round, uint64_t motion, const char *token, db_time now)
{
	(void)pthread_mutex_lock(&round->mutex);
	/* A hold that comes after too long a silence is not accepted. */
	if (round->moves && motion == round->motion &&
	    (round->held == 0 || now - round->held < DB_WEB_GRIP_LATE)) {
		round->held = now;
		snprintf(round->token, sizeof(round->token), "%s", token);
	}
	(void)pthread_mutex_unlock(&round->mutex);
}

void db_web_round_end(struct db_web_round *round)
{
	(void)pthread_mutex_lock(&round->mutex);
	round->ends = true;
	(void)pthread_mutex_unlock(&round->mutex);
	signal_fd(round->wake);
}
