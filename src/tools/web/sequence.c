/* SPDX-License-Identifier: Apache-2.0 */
#include "web/sequence.h"
#include "client/lanes.h"
#include "client/log.h"
#include "web/service.h"
#include "web/stops.h"
#include "web/tokens.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define DRIVE_MAX 64
#define POSITION_MAX 33

/* A stop without confirmation is repeated at this interval, and for this time. */
#define STOP_AGAIN (200 * DB_NS_PER_MS)
#define STOP_WITHIN (3 * DB_NS_PER_S)

struct step {
	char drive[DRIVE_MAX];
	char position[POSITION_MAX];
	double velocity; /* 0: the drive's own */
	db_time wait;    /* after its end */
};

struct db_web_sequence {
	struct db_web_server *server;
	struct db_link *act;    /* NULL: lost */
	sd_event_source *timer; /* fires when the grip is overdue */
	struct db_web_caller caller;
	struct db_web_grip grip;
	char token[DB_WEB_TOKEN_MAX]; /* of its latest accepted beat */
	char since[DB_WEB_TOKEN_MAX]; /* of the first beat: a drive stopped later is not moved */
	struct step steps[DB_WEB_STEPS_MAX];
	size_t count;
	size_t at;          /* the present step */
	size_t begun;       /* steps that were sent */
	bool moves;         /* its end is awaited */
	db_time next_at;    /* the next one is not sent before */
	unsigned answers;   /* of steps, awaited: also those of former grips */
	bool moved;         /* a step was sent, and no stop confirmed since */
	unsigned stops;     /* stops without an answer */
	db_time stop_again; /* DB_TIME_NEVER: the stop is not to be repeated */
	db_time stop_by;
	char text[512]; /* the error's text */
};

static void settle(struct db_web_sequence *sequence);

/* --- stopping --------------------------------------------------------------------------------- */

static void on_stop_answer(void *data, json_t *parameters, const struct db_client_error *error,
                           bool more)
{
	struct db_web_sequence *sequence = data;
	const json_t *stopped = json_object_get(parameters, "stopped");
	bool good = !error && json_array_size(stopped) > 0;
	const json_t *one;
	size_t i;

	(void)more;
	json_array_foreach(stopped, i, one)
	{
		const char *result = json_string_value(json_object_get(one, "result"));

		good = good && result && strcmp(result, "ok") == 0;
	}
	sequence->stops--;
	if (good) {
		sequence->moved = false;
		sequence->stop_again = DB_TIME_NEVER;
	}
	settle(sequence);
}

/* Of all drives that it has moved: that a former step has ended was said by its drive, and costs
 * nothing to make sure of. */
static void send_stop(struct db_web_sequence *sequence)
{
	json_t *drives = json_array();

	for (size_t i = 0; i < sequence->begun; i++) {
		bool there = false;

		for (size_t k = 0; k < i; k++)
			there = there ||
			        strcmp(sequence->steps[k].drive, sequence->steps[i].drive) == 0;
		if (!there)
			(void)json_array_append_new(drives, json_string(sequence->steps[i].drive));
	}
	/* A stop of no drive would be one of all. */
	if (json_array_size(drives) == 0) {
		json_decref(drives);
		return;
	}
	sequence->stops++;
	if (!db_web_stops_send(sequence->server, &sequence->caller, "Stop",
	                       json_pack("{s:o}", "drives", drives),
	                       sequence->act ? on_stop_answer : NULL, sequence) ||
	    !sequence->act)
		sequence->stops--;
}

static void stop_drives(struct db_web_sequence *sequence)
{
	db_time now = db_client_now();

	db_client_log(DB_CLIENT_NOTICE, "%s: sequence ended at step %zu: %s", sequence->caller.text,
	              sequence->at + 1, db_web_grip_ends[sequence->grip.end]);
	sequence->server->counts.late_jogs += sequence->grip.end == DB_WEB_GRIP_OVERDUE;
	sequence->moves = false;
	sequence->stop_again = now + STOP_AGAIN;
	sequence->stop_by = now + STOP_WITHIN;
	send_stop(sequence);
}

/* --- steps ------------------------------------------------------------------------------------ */

/* True if nothing can move because of a step that failed like this. */
static bool is_refusal(const struct db_client_error *error)
{
	static const char *const sure[] = { "refused",        "out_of_range", "limit",    "latched",
		                            "unsupported",    "offline",      "bus_down", "busy",
		                            "not_in_control", "rate_limited" };
	const char *result = json_string_value(json_object_get(error->parameters, "result"));

	for (size_t i = 0; result && i < sizeof(sure) / sizeof(sure[0]); i++) {
		if (strcmp(result, sure[i]) == 0)
			return true;
	}
	/* Errors without a result are about the form of a call, or its position: it is not begun.
	 */
	return !result && strcmp(error->name, DB_CLIENT_LOST) != 0 &&
	       strcmp(error->name, DB_CLIENT_TIMEOUT) != 0;
}

/* `error`: NULL when the step may still move its drive. */
static void fail_step(struct db_web_sequence *sequence, const struct db_client_error *error)
{
	json_t *told = error ? db_web_error_describe(error, NULL) : NULL;
	const char *text = told ? json_string_value(json_object_get(told, "text")) :
	                          "its end is not known";
	const struct step *step = &sequence->steps[sequence->at];

	snprintf(sequence->text, sizeof(sequence->text), "step %zu, %s to %s: %s", sequence->at + 1,
	         step->drive, step->position, text ? text : "");
	json_decref(told);
	db_client_log(DB_CLIENT_NOTICE, "%s: sequence: %s", sequence->caller.text, sequence->text);
	/* A drive that was not set in motion by this is not stopped: others may move it. */
	if (error && is_refusal(error))
		sequence->begun = sequence->at;
	sequence->moves = false;
	db_web_grip_finish(&sequence->grip, DB_WEB_GRIP_REFUSED);
}

static void on_step_answer(void *data, json_t *parameters, const struct db_client_error *error,
                           bool more)
{
	struct db_web_sequence *sequence = data;
	const char *result = json_string_value(json_object_get(parameters, "result"));
	bool ended = !error && result &&
	             (strcmp(result, "ok") == 0 || strcmp(result, "unproven") == 0);

	if (more) {
		/* The stop may have come to the service before this step. */
		if (!sequence->moves && sequence->act)
			send_stop(sequence);
		return;
	}
	sequence->answers--;
	/* db_web_sequence_lose() handles the lost connection. */
	if (error && strcmp(error->name, DB_CLIENT_LOST) == 0)
		return;
	if (sequence->moves && !ended) {
		fail_step(sequence, error);
		if (sequence->begun > 0)
			stop_drives(sequence);
		else
			sequence->moved = false;
	} else if (sequence->moves) {
		sequence->moves = false;
		sequence->next_at = db_client_now() + sequence->steps[sequence->at].wait;
		sequence->at++;
	}
	settle(sequence);
}

/* With the token of a beat that has just come. */
static void send_step(struct db_web_sequence *sequence)
{
	const struct step *step = &sequence->steps[sequence->at];
	json_t *arguments = json_object();

	if (step->velocity != 0.0)
		(void)json_object_set_new(arguments, "target_velocity", json_real(step->velocity));
	db_client_log(DB_CLIENT_NOTICE, "%s: sequence: step %zu of %zu: %s to %s",
	              sequence->caller.text, sequence->at + 1, sequence->count, step->drive,
	              step->position);
	sequence->answers++;
	sequence->begun = sequence->at + 1;
	sequence->moves = true;
	sequence->moved = true;
	if (db_link_send(sequence->act, "Run",
	                 json_pack("{s:s, s:s, s:s, s:o, s:b, s:i, s:s, s:s}", "drive", step->drive,
	                           "command", "move_absolute", "position", step->position,
	                           "arguments", arguments, "until_end", 1, "hold_ms",
	                           (int)(DB_WEB_GRIP_LATE / DB_NS_PER_MS), "token", sequence->token,
	                           "not_stopped_since", sequence->since),
	                 true, on_step_answer, sequence) != 0)
		sequence->answers--;
}

/* Stops what the state of the grip does not hold any more. */
static void settle(struct db_web_sequence *sequence)
{
	bool held = db_web_grip_is_held(&sequence->grip);

	if (held && !sequence->moves && sequence->at == sequence->count &&
	    db_client_now() >= sequence->next_at) {
		db_web_grip_finish(&sequence->grip, DB_WEB_GRIP_DONE);
		sequence->moved = false;
		held = false;
	}
	if (!held && sequence->moved && sequence->stop_again == DB_TIME_NEVER &&
	    sequence->stops == 0)
		stop_drives(sequence);
	(void)sd_event_source_set_time(sequence->timer,
	                               (uint64_t)(sequence->grip.until / DB_NS_PER_US));
	(void)sd_event_source_set_enabled(sequence->timer, held ? SD_EVENT_ONESHOT : SD_EVENT_OFF);
}

static int on_overdue(sd_event_source *source, uint64_t us, void *data)
{
	struct db_web_sequence *sequence = data;

	(void)source;
	(void)us;
	db_web_grip_look(&sequence->grip, db_client_now());
	settle(sequence);
	return 0;
}

/* --- the page's beats ------------------------------------------------------------------------- */

/* The number of steps; 0: it is no list of them. */
static size_t read_steps(const json_t *json, struct step steps[DB_WEB_STEPS_MAX])
{
	const json_t *one;
	size_t i;

	if (json_array_size(json) > DB_WEB_STEPS_MAX)
		return 0;
	json_array_foreach(json, i, one)
	{
		const char *drive = json_string_value(json_object_get(one, "drive"));
		const char *position = json_string_value(json_object_get(one, "position"));
		const json_t *velocity = json_object_get(one, "velocity");
		double wait_ms = json_number_value(json_object_get(one, "wait_ms"));

		if (!drive || drive[0] == '\0' || strlen(drive) >= DRIVE_MAX || !position ||
		    strlen(position) >= POSITION_MAX ||
		    (velocity && !json_is_null(velocity) && !json_is_number(velocity)) ||
		    !(wait_ms >= 0.0 && wait_ms <= DB_WEB_STEP_WAIT_MAX))
			return 0;
		snprintf(steps[i].drive, DRIVE_MAX, "%s", drive);
		snprintf(steps[i].position, POSITION_MAX, "%s", position);
		steps[i].velocity = json_number_value(velocity);
		steps[i].wait = (db_time)wait_ms * DB_NS_PER_MS;
	}
	return json_array_size(json);
}

/* A new grip has begun. */
static void begin(struct db_web_sequence *sequence, const struct step *steps, size_t count,
                  const char *token, db_time now)
{
	snprintf(sequence->since, sizeof(sequence->since), "%s", token);
	memcpy(sequence->steps, steps, count * sizeof(*steps));
	sequence->count = count;
	sequence->at = 0;
	sequence->begun = 0;
	sequence->next_at = now;
	sequence->text[0] = '\0';
	sequence->server->counts.jogs++;
	db_client_log(DB_CLIENT_NOTICE, "%s: sequence of %zu steps begins", sequence->caller.text,
	              count);
}

/* A grip that cannot begin is over: later beats of it move nothing. */
static void refuse_grip(struct db_web_sequence *sequence, const char *text)
{
	db_web_grip_finish(&sequence->grip, DB_WEB_GRIP_REFUSED);
	snprintf(sequence->text, sizeof(sequence->text), "%s", text);
}

static void handle_beat(struct db_web_sequence *sequence, const struct db_web_request *request,
                        uint64_t number, uint64_t beat, db_time now)
{
	const char *token = json_string_value(json_object_get(request->parameters, "token"));
	bool held = json_is_true(json_object_get(request->parameters, "held"));
	db_time age = db_web_tokens_age(&request->server->service->tokens, token, now);
	bool is_first = number > sequence->grip.number;
	struct step steps[DB_WEB_STEPS_MAX];
	size_t count = is_first ? read_steps(json_object_get(request->parameters, "steps"), steps) :
	                          0;
	bool was_over = db_web_sequence_is_over(sequence, now) && sequence->answers == 0;

	db_web_grip_take(&sequence->grip, number, beat, held ? 1.0 : 0.0, age, now);
	if (is_first && sequence->grip.end == DB_WEB_GRIP_OLD) {
		db_web_tokens_write_late(sequence->text, age);
	} else if (is_first && db_web_grip_is_held(&sequence->grip)) {
		if (!was_over)
			refuse_grip(sequence, "the sequence before is still being stopped");
		else if (count == 0)
			refuse_grip(sequence, "it has no steps");
		else
			begin(sequence, steps, count, token, now);
	}
	/* The beat was accepted. */
	if (!db_web_grip_is_held(&sequence->grip) || sequence->grip.number != number ||
	    sequence->grip.beat != beat || !token || !sequence->act)
		return;
	snprintf(sequence->token, sizeof(sequence->token), "%s", token);
	if (sequence->moves)
		(void)db_link_tell(sequence->act, "Beat",
		                   json_pack("{s:s, s:s}", "drive",
		                             sequence->steps[sequence->at].drive, "token",
		                             sequence->token));
	else if (sequence->at < sequence->count && now >= sequence->next_at &&
	         sequence->answers == 0)
		send_step(sequence);
}

const char *db_web_sequence_take(struct db_web_sequence *sequence, struct db_web_request *request)
{
	json_int_t grip = json_integer_value(json_object_get(request->parameters, "grip"));
	json_int_t beat = json_integer_value(json_object_get(request->parameters, "beat"));
	const json_t *steps = json_object_get(request->parameters, "steps");
	struct step read[DB_WEB_STEPS_MAX];
	db_time left;
	bool mine;
	bool held;

	if (grip < 1 || beat < 1 ||
	    !json_is_boolean(json_object_get(request->parameters, "held")) ||
	    (steps && read_steps(steps, read) == 0)) {
		db_web_request_refuse(
			request, MHD_HTTP_BAD_REQUEST, "BadRequest",
			"a beat is {\"grip\": from 1, \"beat\": from 1, \"held\": ..., \"token\": "
			"the newest one of the overview, \"steps\": 1 to %d of {\"drive\", "
			"\"position\", \"velocity\", \"wait_ms\": at most %d}}",
			DB_WEB_STEPS_MAX, DB_WEB_STEP_WAIT_MAX);
		return NULL;
	}
	sequence->caller = db_web_request_caller(request);
	handle_beat(sequence, request, (uint64_t)grip, (uint64_t)beat, db_client_now());
	settle(sequence);
	/* Of a former grip there is nothing more to tell: it is over. */
	mine = (uint64_t)grip == sequence->grip.number;
	held = mine && db_web_grip_is_held(&sequence->grip);
	left = sequence->next_at - db_client_now();
	if (sequence->moves || left < 0 || !held)
		left = 0;
	db_web_request_answer(request, MHD_HTTP_OK,
	                      json_pack("{s:b, s:s, s:s, s:i, s:b, s:I}", "held", held, "why",
	                                mine ? db_web_grip_ends[sequence->grip.end] : "released",
	                                "text", mine ? sequence->text : "", "step",
	                                (int)sequence->at + 1, "moves", sequence->moves, "wait_ms",
	                                (json_int_t)(left / DB_NS_PER_MS)));
	return sequence->moves ? sequence->steps[sequence->at].drive : NULL;
}

void db_web_sequence_yield(struct db_web_sequence *sequence, const char *drive)
{
	bool mine = !drive;

	for (size_t i = 0; !mine && i < sequence->count; i++)
		mine = strcmp(sequence->steps[i].drive, drive) == 0;
	if (mine)
		db_web_sequence_end(sequence, DB_WEB_GRIP_STOPPED);
}

void db_web_sequence_end(struct db_web_sequence *sequence, enum db_web_grip_end end)
{
	db_web_grip_finish(&sequence->grip, end);
	settle(sequence);
}

void db_web_sequence_lose(struct db_web_sequence *sequence)
{
	bool moved = sequence->moved;

	sequence->act = NULL;
	db_web_grip_finish(&sequence->grip, DB_WEB_GRIP_LOST);
	sequence->moves = false;
	sequence->moved = false;
	if (moved) {
		db_client_log(DB_CLIENT_WARNING,
		              "%s: the connection was lost during a sequence; its drives are told "
		              "to stop over another one",
		              sequence->caller.text);
		send_stop(sequence);
	}
	sequence->stop_again = DB_TIME_NEVER;
	settle(sequence);
}

void db_web_sequence_tick(struct db_web_sequence *sequence, db_time now)
{
	if (now < sequence->stop_again)
		return;
	sequence->stop_again = now < sequence->stop_by ? now + STOP_AGAIN : DB_TIME_NEVER;
	/* The service itself continues a stop that it has not answered. */
	if (sequence->stop_again != DB_TIME_NEVER && sequence->stops == 0) {
		send_stop(sequence);
	} else if (sequence->stop_again == DB_TIME_NEVER) {
		sequence->moved = false;
		db_client_log(DB_CLIENT_ERROR,
		              "%s: the drives of a sequence do not confirm that they stop",
		              sequence->caller.text);
	}
}

bool db_web_sequence_is_over(const struct db_web_sequence *sequence, db_time now)
{
	return !db_web_grip_is_held(&sequence->grip) && !sequence->moves &&
	       (!sequence->moved ||
	        (sequence->stop_again != DB_TIME_NEVER && now >= sequence->stop_by));
}

/* --- life ------------------------------------------------------------------------------------- */

struct db_web_sequence *db_web_sequence_new(struct db_web_server *server, struct db_link *act)
{
	struct db_web_sequence *sequence = calloc(1, sizeof(*sequence));

	if (!sequence)
		return NULL;
	sequence->server = server;
	sequence->act = act;
	sequence->grip.until = DB_TIME_NEVER;
	sequence->stop_again = DB_TIME_NEVER;
	if (db_web_server_add_timer(server, &sequence->timer, on_overdue, sequence) < 0) {
		free(sequence);
		return NULL;
	}
	return sequence;
}

void db_web_sequence_free(struct db_web_sequence *sequence)
{
	if (!sequence)
		return;
	db_stops_forget(db_lanes_stops(sequence->server->lanes), sequence);
	sd_event_source_disable_unref(sequence->timer);
	free(sequence);
}
