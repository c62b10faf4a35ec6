/* SPDX-License-Identifier: Apache-2.0 */
#include "commission/round.h"
#include "ctl/commission_talk.h"
#include "ctl/ctl_private.h"
#include "ctl/say.h"
#include "words/value.h"

#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

struct commissioning {
	struct db_ctl *ctl;
	const char *drive;
	struct db_ctl_talk talk;
	struct db_commission_round round;
	struct db_commission_asker asker;
	enum db_ctl_status saved;
};

/* --- what was known of an earlier round ------------------------------------------------------- */

static enum db_ctl_status load_state(struct commissioning *work)
{
	json_error_t error;
	json_t *state;
	const char *name = work->drive;
	enum db_ctl_status status = DB_CTL_OK;

	if (!work->ctl->state || access(work->ctl->state, F_OK) != 0)
		return DB_CTL_OK;
	state = json_load_file(work->ctl->state, 0, &error);
	if (!state || strcmp(db_words_text(state, "drive"), name) != 0 ||
	    !json_is_array(json_object_get(state, "done")) ||
	    !json_is_array(json_object_get(state, "verdicts")))
		status = db_ctl_complain(work->ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                         "%s is no state of a commissioning of %s",
		                         work->ctl->state, name);
	else {
		(void)json_array_extend(work->round.done, json_object_get(state, "done"));
		(void)json_array_extend(work->round.engine.verdicts,
		                        json_object_get(state, "verdicts"));
	}
	json_decref(state);
	return status;
}

/* Atomically, so that an end at any moment leaves the former file. */
static enum db_ctl_status save_state(const struct commissioning *work, json_t *verdicts,
                                     json_t *done)
{
	char fresh[1024];
	json_t *state;
	bool saved;

	if (!work->ctl->state)
		return DB_CTL_OK;
	state = json_pack("{s:s, s:O, s:O}", "drive", work->drive, "done", done, "verdicts",
	                  verdicts);
	snprintf(fresh, sizeof(fresh), "%s.new", work->ctl->state);
	saved = json_dump_file(state, fresh, JSON_INDENT(1)) == 0 &&
	        rename(fresh, work->ctl->state) == 0;
	json_decref(state);
	return saved ? DB_CTL_OK :
	               db_ctl_complain(work->ctl, DB_CTL_NO, "io.drivebridge.Client.NotWritten",
	                               "%s: %s", work->ctl->state, strerror(errno));
}

/* --- at the terminal -------------------------------------------------------------------------- */

static bool hear_signal(void *data)
{
	const struct commissioning *work = data;
	int number = db_ctl_signals_read(work->asker.fd);

	return number == 0 || number == SIGWINCH;
}

static const char *ask(void *data, struct db_commission_act *act,
                       const struct db_commission_action *question)
{
	struct commissioning *work = data;

	return db_ctl_talk_ask(&work->talk, act, question);
}

static void show_step(void *data, const struct db_commission_step *step)
{
	const struct commissioning *work = data;

	if (!work->ctl->json)
		printf("\n%s: %s\n", step->name, db_ctl_say(step->description));
}

static bool show_verdicts(void *data, const struct db_commission_step *step, json_t *verdicts,
                          json_t *done)
{
	struct commissioning *work = data;
	size_t i;
	const json_t *verdict;

	if (!work->ctl->json)
		db_commission_report_verdicts(stdout, verdicts, step->name, db_ctl_language());
	json_array_foreach(verdicts, i, verdict)
	{
		if (work->ctl->json && strcmp(db_words_text(verdict, "step"), step->name) == 0)
			db_ctl_print_json(verdict);
	}
	work->saved = save_state(work, verdicts, done);
	return work->saved == DB_CTL_OK;
}

static void show_motion(void *data, bool moving, bool again)
{
	static const char why[] = DB_CTL_TEXT(
		"nothing was heard of the drive for a moment, so its times are doubtful");
	const struct commissioning *work = data;
	json_t *object;

	if (!moving || !again)
		return;
	if (!work->ctl->json) {
		printf("  %s: %s\n", db_ctl_say("once more"), db_ctl_say(why));
		return;
	}
	object = json_pack("{s:s}", "again", why);
	db_ctl_print_json(object);
	json_decref(object);
}

/* The user sits at this terminal: the program's own token is enough. */
static const char *hold(void *data, const char *own)
{
	(void)data;
	return own;
}

/* --- the end ---------------------------------------------------------------------------------- */

static enum db_ctl_status write_report(const struct commissioning *work,
                                       const struct db_commission_report *report)
{
	char path[300];
	FILE *file;
	bool written;

	snprintf(path, sizeof(path), "%s.commissioning.txt", report->drive);
	if (work->ctl->output)
		snprintf(path, sizeof(path), "%s", work->ctl->output);
	file = fopen(path, "we");
	if (file)
		db_commission_report_write(file, report);
	written = file && !ferror(file);
	if (file && fclose(file) != 0)
		written = false;
	if (!written)
		return db_ctl_complain(work->ctl, DB_CTL_NO, "io.drivebridge.Client.NotWritten",
		                       "%s: %s", path, strerror(errno));
	if (!work->ctl->json) {
		fputs("\n", stdout);
		printf(db_ctl_say("the report is in %s"), path);
		fputs("\n", stdout);
	}
	return DB_CTL_OK;
}

static void print_end(const struct commissioning *work, const struct db_commission_report *report)
{
	char *sections;
	json_t *object;

	if (!work->ctl->json) {
		fputs("\n", stdout);
		printf(db_ctl_say("%zu contradicted, %zu proven, %zu not seen"),
		       db_commission_report_count(report->verdicts, DB_COMMISSION_CONTRADICTED),
		       db_commission_report_count(report->verdicts, DB_COMMISSION_PROVEN),
		       db_commission_report_count(report->verdicts, DB_COMMISSION_NOT_SEEN));
		printf("\n\n%s\n\n",
		       db_ctl_say("for the configuration, then drivebridgectl reload:"));
		db_commission_report_sections(stdout, report);
		return;
	}
	sections = db_commission_report_copy(report, db_commission_report_sections);
	object = json_pack("{s:s, s:s, s:O, s:O, s:s}", "drive", report->drive, "family",
	                   report->family, "done", report->done, "verdicts", report->verdicts,
	                   "sections", sections ? sections : "");
	db_ctl_print_json(object);
	json_decref(object);
	free(sections);
}

static enum db_ctl_status finish(struct commissioning *work)
{
	struct db_commission_report report = db_commission_round_report(&work->round);
	enum db_ctl_status status;

	print_end(work, &report);
	status = write_report(work, &report);
	if (work->round.act.lost)
		return db_ctl_complain(
			work->ctl, DB_CTL_UNREACHABLE, DB_CLIENT_LOST,
			"the connection was lost; the service stops what this program "
			"held");
	if (work->round.act.interrupted)
		return db_ctl_complain(
			work->ctl, DB_CTL_NO, "io.drivebridge.Client.Interrupted",
			"interrupted: %s was stopped; what was seen is in the report",
			report.drive);
	if (status == DB_CTL_OK &&
	    db_commission_report_count(report.verdicts, DB_COMMISSION_CONTRADICTED) > 0)
		status = DB_CTL_NO;
	return status;
}

/* --- the command ------------------------------------------------------------------------------ */

static enum db_ctl_status list_steps(const struct db_ctl *ctl)
{
	for (const struct db_commission_step *step = db_commission_list; step->name; step++) {
		if (ctl->json) {
			json_t *object = json_pack("{s:s, s:b, s:b, s:s}", "step", step->name,
			                           "moves", step->moves, "chosen", step->chosen,
			                           "description", step->description);

			db_ctl_print_json(object);
			json_decref(object);
		} else {
			printf("%-12s  %s%s%s\n", step->name, db_ctl_say(step->description),
			       step->moves ? db_ctl_say("; moves") : "",
			       step->chosen ? db_ctl_say("; only with --step") : "");
		}
	}
	return DB_CTL_OK;
}

/* Reads --velocity and --duration. */
static enum db_ctl_status read_order(struct db_ctl *ctl, struct db_commission_order *order)
{
	enum db_ctl_status status = DB_CTL_OK;
	char problem[256] = "";
	json_t *registers;
	json_t *value;

	if (ctl->duration &&
	    (!db_words_parse_seconds(ctl->duration, &order->seconds) ||
	     order->seconds > DB_COMMISSION_LONGEST_S || order->seconds < DB_COMMISSION_SHORTEST_S))
		return db_ctl_complain(ctl, DB_CTL_USAGE, DB_CLIENT_SERVICE "BadValue",
		                       "--duration %s: %g to %g s is right", ctl->duration,
		                       DB_COMMISSION_SHORTEST_S, DB_COMMISSION_LONGEST_S);
	if (!ctl->velocity)
		return DB_CTL_OK;
	registers = db_ctl_read_registers(ctl, order->drive, &status);
	if (!registers)
		return status;
	value = db_words_parse_value(db_words_look_up(registers, "target_velocity"), ctl->velocity,
	                             problem, sizeof(problem));
	order->velocity = fabs(json_number_value(value));
	if (!value || order->velocity <= 0)
		status = db_ctl_complain(ctl, DB_CTL_USAGE, DB_CLIENT_SERVICE "BadValue",
		                         "--velocity: %s",
		                         value ? DB_CTL_TEXT("above 0 is right") : problem);
	json_decref(value);
	json_decref(registers);
	return status;
}

static enum db_ctl_status run_round(struct commissioning *work,
                                    const struct db_commission_order *order, int only)
{
	struct db_client_error error = { .parameters = NULL };
	enum db_ctl_status status = DB_CTL_OK;

	if (db_commission_round_open(&work->round, order, &work->asker, &error) != 0)
		status = db_ctl_fail(work->ctl, &error);
	db_client_error_clear(&error);
	if (status == DB_CTL_OK)
		status = load_state(work);
	if (status == DB_CTL_OK) {
		db_commission_round_run(&work->round, only);
		status = work->saved;
	}
	if (status == DB_CTL_OK)
		status = finish(work);
	db_commission_round_close(&work->round);
	return status;
}

enum db_ctl_status db_ctl_commission(struct db_ctl *ctl, int count, char **arguments)
{
	struct commissioning work = { .ctl = ctl, .drive = arguments[0] };
	struct db_commission_order order = { .socket = ctl->socket, .drive = arguments[0] };
	enum db_ctl_status status;
	int only = ctl->step ? db_commission_find(ctl->step) : -1;

	(void)count;
	if (!db_ctl_find_drive(ctl, arguments[0]))
		return DB_CTL_USAGE;
	if (ctl->list)
		return list_steps(ctl);
	if (ctl->step && only < 0)
		return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                       "there is no step \"%s\"; --list has them", ctl->step);
	status = read_order(ctl, &order);
	if (status == DB_CTL_OK)
		status = db_ctl_talk_open(&work.talk, ctl);
	if (status != DB_CTL_OK)
		return status;
	work.asker = (struct db_commission_asker){ .data = &work,
		                                   .fd = db_ctl_signals_open(),
		                                   .hear = hear_signal,
		                                   .ask = ask,
		                                   .begin = show_step,
		                                   .end = show_verdicts,
		                                   .moves = show_motion,
		                                   .hold = hold };
	status = run_round(&work, &order, only);
	db_ctl_signals_close(work.asker.fd);
	db_ctl_talk_close(&work.talk);
	return status;
}
