/* SPDX-License-Identifier: Apache-2.0 */
#include "client/clock.h"
#include "ctl/ctl_private.h"
#include "ctl/say.h"
#include "ctl/search.h"
#include "setup/move.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define USAGE "io.drivebridge.Client.Usage"

struct doing {
	struct db_ctl *ctl;
	struct db_setup_move move;
	enum db_ctl_status status; /* of what failed last */
	bool reported;             /* the error that comes next is printed */
};

static void look(struct doing *doing, const struct db_setup_action *action)
{
	json_t *parameters = json_pack("{s:s, s:I, s:I}", "bus",
	                               db_words_text(doing->move.bus, "name"), "first",
	                               action->address, "last", action->address);
	struct db_client_error error = { .parameters = NULL };
	struct db_ctl_search search;
	enum db_ctl_status status;

	if (action->speed != 0)
		(void)json_object_set_new(parameters, "speeds", json_pack("[I]", action->speed));
	status = db_ctl_search(doing->ctl, parameters, &search);
	if (status == DB_CTL_OK && search.interrupted)
		status = db_ctl_complain(doing->ctl, DB_CTL_NO, "io.drivebridge.Client.Interrupted",
		                         "interrupted; nothing more was done");
	if (status == DB_CTL_OK)
		db_setup_move_take(&doing->move, search.finds, false, db_client_now());
	else {
		doing->reported = true;
		doing->status = status;
		(void)db_setup_move_fail(&doing->move, &error);
	}
	db_ctl_search_clear(&search);
}

static void set(struct doing *doing, const struct db_setup_action *action)
{
	json_t *parameters = json_pack("{s:s, s:I, s:s}", "bus",
	                               db_words_text(doing->move.bus, "name"), "address",
	                               action->address, "what", action->what);
	struct db_client_error error = { .parameters = NULL };
	json_t *answer = NULL;

	if (action->has_value)
		(void)json_object_set_new(parameters, "value", json_integer(doing->move.to));
	if (action->speed != 0)
		(void)json_object_set_new(parameters, "speeds", json_pack("[I]", action->speed));
	if (db_client_call(doing->ctl->client, "SetUp", parameters, DB_CTL_DRIVE_TIMEOUT_MS,
	                   &answer, &error) == 0) {
		db_setup_move_take(&doing->move, NULL, false, db_client_now());
	} else if (db_setup_move_fail(&doing->move, &error)) {
		doing->reported = true;
		doing->status = db_ctl_fail(doing->ctl, &error);
	}
	db_client_error_clear(&error);
	json_decref(answer);
}

static void ask(struct doing *doing, const struct db_setup_action *action)
{
	bool json = doing->ctl->json;
	char line[16];
	bool yes;

	if (!action->question) {
		yes = !json && fgets(line, sizeof(line), stdin);
	} else {
		if (!json)
			db_ctl_translate_lines(stdout, action->text);
		doing->status = db_ctl_ask(doing->ctl, "%s", db_ctl_say(action->question));
		yes = doing->status == DB_CTL_OK;
	}
	db_setup_move_take(&doing->move, NULL, yes, db_client_now());
}

static void say(const struct doing *doing, const struct db_setup_action *action)
{
	const struct db_setup_move *move = &doing->move;
	json_t *object;

	if (!doing->ctl->json) {
		db_ctl_translate_lines(stdout, action->text);
		printf("%s%s\n", action->configuration[0] ? "\n\n" : "", action->configuration);
		(void)fflush(stdout);
	} else if (move->done) {
		object = json_pack("{s:s, s:I, s:I, s:s, s:s}", "bus",
		                   db_words_text(move->bus, "name"), "from", move->from, "to",
		                   move->to, "identity", move->identity, "drive", move->drive);
		db_ctl_print_json(object);
		json_decref(object);
	}
}

static enum db_ctl_status carry_out(struct doing *doing)
{
	const struct timespec pause = { .tv_nsec = DB_SETUP_PAUSE_MS * 1000000L };
	enum db_ctl_status status = DB_CTL_OK;

	for (;;) {
		struct db_setup_action action = db_setup_move_next(&doing->move, db_client_now());

		switch (action.kind) {
		case DB_SETUP_LOOK:
			look(doing, &action);
			break;
		case DB_SETUP_SET:
			set(doing, &action);
			break;
		case DB_SETUP_SAY:
			say(doing, &action);
			break;
		case DB_SETUP_ASK:
			ask(doing, &action);
			break;
		case DB_SETUP_PAUSE:
			(void)nanosleep(&pause, NULL);
			db_setup_move_take(&doing->move, NULL, false, db_client_now());
			break;
		case DB_SETUP_FAIL:
			/* The first reason is the exit status. */
			if (!doing->reported)
				status = db_ctl_complain(doing->ctl, DB_CTL_NO, action.error, "%s",
				                         action.text);
			doing->status = doing->status != DB_CTL_OK ? doing->status : status;
			doing->reported = false;
			break;
		case DB_SETUP_END:
		default:
			return doing->move.done ? DB_CTL_OK : doing->status;
		}
	}
}

/* --- the commands ----------------------------------------------------------------------------- */

static bool read_number(const struct db_ctl *ctl, const char *text, json_int_t *number)
{
	char *end;

	errno = 0;
	*number = strtoll(text, &end, 10);
	if (text[0] != '\0' && *end == '\0' && errno == 0 && *number >= 0 && *number <= 4000000)
		return true;
	(void)db_ctl_complain(ctl, DB_CTL_USAGE, USAGE, "\"%s\" is not a number that can be here",
	                      text);
	return false;
}

static enum db_ctl_status begin(struct db_ctl *ctl, bool is_address, char **arguments)
{
	struct doing doing = { .ctl = ctl, .move.is_address = is_address };
	struct db_setup_move *move = &doing.move;
	enum db_ctl_status status;
	const char *mistake;

	move->bus = db_ctl_find_bus(ctl, arguments[0]);
	if (!move->bus || !read_number(ctl, arguments[1], &move->from) ||
	    !read_number(ctl, arguments[2], &move->to) ||
	    (ctl->speed && !read_number(ctl, ctl->speed, &move->speed)))
		return DB_CTL_USAGE;
	mistake = db_setup_move_check(move);
	if (mistake)
		return db_ctl_complain(ctl, DB_CTL_USAGE, USAGE, "%s", mistake);
	status = carry_out(&doing);
	db_client_error_clear(&move->error);
	return status;
}

enum db_ctl_status db_ctl_address(struct db_ctl *ctl, int count, char **arguments)
{
	(void)count;
	return begin(ctl, true, arguments);
}

enum db_ctl_status db_ctl_baud(struct db_ctl *ctl, int count, char **arguments)
{
	(void)count;
	return begin(ctl, false, arguments);
}
