/* SPDX-License-Identifier: Apache-2.0 */
#include "client/clock.h"
#include "ctl/assign.h"
#include "ctl/ctl_private.h"
#include "ctl/say.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* A command whose end is awaited. */
struct running {
	const struct db_ctl *ctl;
	const char *drive;
	const char *command;
	enum db_ctl_status status;
	bool ended;
	bool heard;     /* the service has answered: it has the command */
	bool refused;   /* by the drive */
	bool unchecked; /* nobody has looked whether there are such a drive and command */
	bool unknown;   /* and there are not */
};

/* The command's arguments, from the drive's registers, as an array that the caller frees. */
static json_t *choose_arguments(const json_t *registers, const json_t *command)
{
	json_t *chosen = json_array();
	size_t i;
	json_t *name;

	json_array_foreach(json_object_get(command, "arguments"), i, name)
	{
		json_t *reg = db_words_look_up(registers, json_string_value(name));

		if (reg)
			(void)json_array_append(chosen, reg);
	}
	return chosen;
}

static void take_result(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct running *running = data;
	const char *result = db_words_text(parameters, "result");
	json_t *object;

	running->heard = true;
	if (more)
		return;
	running->ended = true;
	running->unknown = running->unchecked && error &&
	                   (strcmp(error->name, DB_CLIENT_SERVICE "NoSuchDrive") == 0 ||
	                    strcmp(error->name, DB_CLIENT_SERVICE "NoSuchCommand") == 0);
	if (running->unknown)
		return;
	if (error) {
		running->status = db_ctl_fail(running->ctl, error);
		running->refused = strcmp(db_words_text(error->parameters, "result"), "refused") ==
		                   0;
		return;
	}
	/* Unproven: the drive has accepted it, and its protocol cannot show more. */
	running->status = strcmp(result, "ok") == 0 || strcmp(result, "unproven") == 0 ||
	                                  (strcmp(result, "pending") == 0 &&
	                                   running->ctl->no_wait) ?
	                          DB_CTL_OK :
	                          DB_CTL_NO;
	if (!running->ctl->json) {
		printf("%s: %s: %s\n", running->drive, running->command, db_ctl_say_name(result));
		return;
	}
	object = json_pack("{s:s, s:s, s:s}", "drive", running->drive, "command", running->command,
	                   "result", result);
	db_ctl_print_json(object);
	json_decref(object);
}

/*
 * Until the command has ended or a signal comes. The service says at once that it has the command;
 * one that does not hangs. Of a stop that is not confirmed soon the user hears what
 * drivebridgectl stop says.
 */
static enum db_ctl_status wait_for_end(struct db_ctl *ctl, struct running *running, bool stops)
{
	struct db_client_error error = { .parameters = NULL };
	int signals = db_ctl_signals_open();
	db_time now = db_client_now();
	db_time warn_at = stops ? now + DB_CTL_STOP_WARN_MS * DB_NS_PER_MS : DB_TIME_NEVER;
	db_time give_up_at = now + DB_CTL_TIMEOUT_MS * DB_NS_PER_MS;
	int turn = 1;

	while (!running->ended && turn >= 0 && now < give_up_at) {
		db_time due = warn_at < give_up_at ? warn_at : give_up_at;

		turn = db_ctl_follow(ctl, signals,
		                     due == DB_TIME_NEVER ?
		                             -1 :
		                             (int)((due - now + DB_NS_PER_MS - 1) / DB_NS_PER_MS));
		now = db_client_now();
		if (running->heard)
			give_up_at = DB_TIME_NEVER;
		if (!running->ended && turn >= 0 && now >= warn_at) {
			db_ctl_stop_warn(ctl);
			warn_at = DB_TIME_NEVER;
		}
	}
	/* Ctrl-C during a motion stops it. */
	if (turn < 0 && db_ctl_stop_drive(ctl, running->drive, &error) == 0)
		running->status = db_ctl_complain(
			ctl, DB_CTL_NO, "io.drivebridge.Client.Interrupted",
			"interrupted: %s has been told to stop", running->drive);
	else if (turn < 0)
		running->status = db_ctl_fail(ctl, &error);
	else if (!running->ended)
		running->status = db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_TIMEOUT,
		                                  "the service does not answer within %d ms",
		                                  DB_CTL_TIMEOUT_MS);
	if (!running->ended && stops)
		(void)db_ctl_complain(ctl, running->status, "io.drivebridge.Client.NotConfirmed",
		                      "the stop is not confirmed: use the emergency stop");
	db_client_error_clear(&error);
	if (signals >= 0)
		(void)close(signals);
	return running->status;
}

/* A drive does not say why it refuses a motion. That its motor has no power is the usual reason. */
static void say_that_it_is_disabled(struct db_ctl *ctl, const struct running *running,
                                    const json_t *registers)
{
	static const char *const motions[] = { "move", "home", "jog", "shake_start",
		                               "start_program" };
	struct db_client_error error = { .parameters = NULL };
	const char *state = NULL;
	json_t *answer = NULL;
	bool moves = false;

	for (size_t i = 0; i < sizeof(motions) / sizeof(motions[0]); i++)
		moves = moves || strncmp(running->command, motions[i], strlen(motions[i])) == 0;
	if (!moves || ctl->json)
		return;
	if (db_client_call(
		    ctl->client, "Read",
		    json_pack("{s:s, s:[s]}", "drive", running->drive, "names", "axis_state"),
		    DB_CTL_TIMEOUT_MS, &answer, &error) == 0)
		state = db_words_code_name(
			db_words_look_up(registers, "axis_state"),
			json_integer_value(
				json_object_get(json_object_get(answer, "values"), "axis_state")));
	if (state && strcmp(state, "Disabled") == 0)
		db_ctl_say_line(stderr, "%s is disabled: drivebridgectl enable %s", running->drive,
		                running->drive);
	db_client_error_clear(&error);
	json_decref(answer);
}

/* Where all places for sessions are taken the service keeps some for stops, and takes there nothing
 * that is asked before: a stop is sent over a connection of its own, at once. False: it is none, or
 * there is no such drive or command. */
static bool stop_first(struct db_ctl *ctl, const char *drive, const char *name,
                       enum db_ctl_status *status)
{
	static const char *const stops[] = { "stop", "quick_stop", "disable" };
	struct running running = { .ctl = ctl, .drive = drive, .command = name, .unchecked = true };
	struct db_client_error error = { .parameters = NULL };
	bool is_stop = false;

	for (size_t i = 0; i < sizeof(stops) / sizeof(stops[0]); i++)
		is_stop = is_stop || strcmp(name, stops[i]) == 0;
	if (!is_stop)
		return false;
	if (db_client_open(ctl->socket, &ctl->client, &error) != 0)
		*status = db_ctl_fail(ctl, &error);
	else if (db_client_send(ctl->client, "Run",
	                        json_pack("{s:s, s:s, s:b}", "drive", drive, "command", name,
	                                  "until_end", !ctl->no_wait),
	                        true, take_result, &running) == 0)
		*status = wait_for_end(ctl, &running, true);
	else
		*status = db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_LOST,
		                          "the service has closed the connection");
	db_client_error_clear(&error);
	if (running.unknown)
		db_ctl_close(ctl);
	return !running.unknown;
}

/* Shows the service how old the command is: one that hangs, and continues after this program has
 * given up, starts no motion any more. Null: there is none, and `status` says why. */
static json_t *ask_moment(struct db_ctl *ctl, enum db_ctl_status *status)
{
	json_t *answer = db_ctl_call(ctl, "Clock", NULL, DB_CTL_TIMEOUT_MS, status);
	json_t *token = json_object_get(answer, "token");

	token = answer && !token ? json_null() : json_incref(token);
	json_decref(answer);
	return token;
}

/* Runs the command of that name with the arguments after it. */
static enum db_ctl_status run_command(struct db_ctl *ctl, const char *drive, const char *name,
                                      int count, char **arguments)
{
	struct running running = { .ctl = ctl, .drive = drive, .command = name };
	enum db_ctl_status status = DB_CTL_USAGE;
	json_t *answer = NULL;
	json_t *registers = NULL;
	json_t *taken = NULL;
	json_t *values = NULL;
	json_t *token = NULL;
	const json_t *command = NULL;
	char unknown[128];

	if (count == 0 && stop_first(ctl, drive, name, &status))
		return status;
	status = db_ctl_open(ctl);
	if (status != DB_CTL_OK)
		return status;
	if (!db_ctl_find_drive(ctl, drive))
		return DB_CTL_USAGE;
	answer = db_ctl_call(ctl, "Commands", json_pack("{s:s}", "drive", drive), DB_CTL_TIMEOUT_MS,
	                     &status);
	snprintf(unknown, sizeof(unknown), "%s has no command", drive);
	if (answer) {
		command = db_ctl_find(ctl, json_object_get(answer, "commands"), name,
		                      DB_CLIENT_SERVICE "NoSuchCommand", unknown);
		status = command ? DB_CTL_OK : DB_CTL_USAGE;
	}
	if (command)
		registers = db_ctl_read_registers(ctl, drive, &status);
	if (registers) {
		taken = choose_arguments(registers, command);
		snprintf(unknown, sizeof(unknown), "%s takes no", name);
		values = db_ctl_read_assignments(
			ctl,
			&(struct db_ctl_assignable){ .drive = drive,
		                                     .registers = registers,
		                                     .taken = taken,
		                                     .unknown = unknown,
		                                     .in_order = true },
			count, arguments, &status);
	}
	if (values)
		token = ask_moment(ctl, &status);
	if (token && db_client_send(ctl->client, "Run",
	                            json_pack("{s:s, s:s, s:O, s:b, s:O}", "drive", drive,
	                                      "command", name, "arguments", values, "until_end",
	                                      !ctl->no_wait, "token", token),
	                            true, take_result, &running) == 0)
		status = wait_for_end(ctl, &running, false);
	else if (token)
		status = db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_LOST,
		                         "the service has closed the connection");
	if (running.refused)
		say_that_it_is_disabled(ctl, &running, registers);
	json_decref(token);
	json_decref(values);
	json_decref(taken);
	json_decref(registers);
	json_decref(answer);
	return status;
}

enum db_ctl_status db_ctl_go(struct db_ctl *ctl, const char *drive, const char *position)
{
	struct running running = { .ctl = ctl, .drive = drive, .command = position };
	enum db_ctl_status status = DB_CTL_OK;
	json_t *token = ask_moment(ctl, &status);
	json_t *registers;

	if (!token)
		return status;
	if (db_client_send(ctl->client, "Run",
	                   json_pack("{s:s, s:s, s:s, s:b, s:o}", "drive", drive, "command",
	                             "move_absolute", "position", position, "until_end",
	                             !ctl->no_wait, "token", token),
	                   true, take_result, &running) != 0)
		return db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_LOST,
		                       "the service has closed the connection");
	status = wait_for_end(ctl, &running, false);
	if (running.refused) {
		enum db_ctl_status read = DB_CTL_OK;

		running.command = "move_absolute";
		registers = db_ctl_read_registers(ctl, drive, &read);
		if (registers)
			say_that_it_is_disabled(ctl, &running, registers);
		json_decref(registers);
	}
	return status;
}

enum db_ctl_status db_ctl_run(struct db_ctl *ctl, int count, char **arguments)
{
	enum db_ctl_status status;
	json_t *answer = NULL;
	json_t *object;
	size_t i;
	size_t at;
	const json_t *command;
	const json_t *name;

	if (count > 1)
		return run_command(ctl, arguments[0], arguments[1], count - 2, arguments + 2);
	status = db_ctl_open(ctl);
	if (status != DB_CTL_OK)
		return status;
	status = DB_CTL_USAGE;
	/* What can be told to this drive, in the form of the help. */
	if (db_ctl_find_drive(ctl, arguments[0]))
		answer = db_ctl_call(ctl, "Commands", json_pack("{s:s}", "drive", arguments[0]),
		                     DB_CTL_TIMEOUT_MS, &status);
	if (ctl->json && answer) {
		object = json_pack("{s:O}", "commands", json_object_get(answer, "commands"));
		db_ctl_print_json(object);
		json_decref(object);
	}
	json_array_foreach(ctl->json ? NULL : json_object_get(answer, "commands"), i, command)
	{
		char usage[512];
		char room[DB_WORDS_TEXT_MAX];
		size_t length;

		snprintf(usage, sizeof(usage), "%s", db_words_text(command, "name"));
		json_array_foreach(json_object_get(command, "arguments"), at, name)
		{
			length = strlen(usage);
			snprintf(usage + length, sizeof(usage) - length, " %s",
			         json_string_value(name));
		}
		db_ctl_wrap(stdout, DB_CTL_WIDTH, 0, 4, usage);
		db_ctl_wrap(stdout, DB_CTL_WIDTH, 8, 8,
		            db_ctl_translate(db_words_text(command, "description"), room));
	}
	json_decref(answer);
	return status;
}

enum db_ctl_status db_ctl_run_short(struct db_ctl *ctl, int count, char **arguments)
{
	static const struct {
		const char *word;
		const char *command;
	} words[] = { { "move", "move_absolute" }, { "clear", "clear_fault" } };
	const char *name = ctl->word;

	for (size_t i = 0; i < sizeof(words) / sizeof(words[0]); i++) {
		if (strcmp(words[i].word, name) == 0)
			name = ctl->relative ? "move_relative" : words[i].command;
	}
	return run_command(ctl, arguments[0], name, count - 1, arguments + 1);
}
