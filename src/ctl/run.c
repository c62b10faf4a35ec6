/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/run.h"
#include "ctl/assign.h"
#include "ctl/signals.h"
#include "ctl/stop.h"

#include <poll.h>
#include <signal.h>
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
};

/* What the command takes, out of the drive's registers, as an array that the caller frees. */
static json_t *choose_arguments(const json_t *registers, const json_t *command)
{
	json_t *chosen = json_array();
	size_t i;
	json_t *name;

	json_array_foreach(json_object_get(command, "arguments"), i, name)
	{
		json_t *reg = db_ctl_look_up(registers, json_string_value(name));

		if (reg)
			(void)json_array_append(chosen, reg);
	}
	return chosen;
}

static void take_result(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct running *running = data;
	const char *result = db_ctl_text(parameters, "result");
	json_t *object;

	if (more)
		return;
	running->ended = true;
	if (error) {
		running->status = db_ctl_fail(running->ctl, error);
		return;
	}
	/* Unproven: the drive has taken it, and its protocol has nothing that could show more. */
	running->status = strcmp(result, "ok") == 0 || strcmp(result, "unproven") == 0 ||
	                                  (strcmp(result, "pending") == 0 &&
	                                   running->ctl->no_wait) ?
	                          DB_CTL_OK :
	                          DB_CTL_NO;
	if (!running->ctl->json) {
		(void)printf("%s: %s: %s\n", running->drive, running->command, result);
		return;
	}
	object = json_pack("{s:s, s:s, s:s}", "drive", running->drive, "command", running->command,
	                   "result", result);
	db_ctl_print_json(object);
	json_decref(object);
}

/* Who interrupts a motion wants it to end. */
static enum db_ctl_status interrupt(struct db_ctl *ctl, const struct running *running)
{
	struct db_client_error error = { .parameters = NULL };
	enum db_ctl_status status;

	if (db_ctl_stop_drive(ctl, running->drive, &error) == 0)
		status = db_ctl_complain(ctl, DB_CTL_NO, "io.drivebridge.Client.Interrupted",
		                         "interrupted: %s has been told to stop", running->drive);
	else
		status = db_ctl_fail(ctl, &error);
	db_client_error_clear(&error);
	return status;
}

/* Until the command has ended or a signal comes. */
static enum db_ctl_status wait_for_end(struct db_ctl *ctl, struct running *running)
{
	struct pollfd fds[2] = { { .fd = db_client_fd(ctl->client) },
		                 { .fd = db_ctl_signals_open(), .events = POLLIN } };
	int signal_number = 0;

	while (!running->ended) {
		fds[0].events = db_client_poll_events(ctl->client);
		(void)poll(fds, 2, -1);
		signal_number = db_ctl_signals_read(fds[1].fd);
		if (signal_number != 0 && signal_number != SIGWINCH && signal_number != SIGTSTP) {
			running->status = interrupt(ctl, running);
			break;
		}
		(void)db_client_handle(ctl->client);
	}
	if (fds[1].fd >= 0)
		(void)close(fds[1].fd);
	return running->status;
}

enum db_ctl_status db_ctl_run(struct db_ctl *ctl, int count, char **arguments)
{
	struct running running = { .ctl = ctl, .drive = arguments[0], .command = arguments[1] };
	enum db_ctl_status status = DB_CTL_USAGE;
	json_t *answer = NULL;
	json_t *registers = NULL;
	json_t *taken = NULL;
	json_t *values = NULL;
	const json_t *command = NULL;
	char unknown[128];

	if (!db_ctl_find_drive(ctl, arguments[0]))
		return DB_CTL_USAGE;
	answer = db_ctl_call(ctl, "Commands", json_pack("{s:s}", "drive", arguments[0]),
	                     DB_CTL_TIMEOUT_MS, &status);
	(void)snprintf(unknown, sizeof(unknown), "%s has no command", arguments[0]);
	if (answer) {
		command = db_ctl_find(ctl, json_object_get(answer, "commands"), arguments[1],
		                      DB_CLIENT_SERVICE "NoSuchCommand", unknown);
		status = command ? DB_CTL_OK : DB_CTL_USAGE;
	}
	if (command)
		registers = db_ctl_read_registers(ctl, arguments[0], &status);
	if (registers) {
		taken = choose_arguments(registers, command);
		(void)snprintf(unknown, sizeof(unknown), "%s takes no", arguments[1]);
		values = db_ctl_read_assignments(ctl, taken, unknown, count - 2, arguments + 2,
		                                 &status);
	}
	if (values &&
	    db_client_send(ctl->client, "Run",
	                   json_pack("{s:s, s:s, s:O, s:b}", "drive", arguments[0], "command",
	                             arguments[1], "arguments", values, "until_end", !ctl->no_wait),
	                   false, take_result, &running) == 0)
		status = wait_for_end(ctl, &running);
	else if (values)
		status = db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_LOST,
		                         "the service has closed the connection");
	json_decref(values);
	json_decref(taken);
	json_decref(registers);
	json_decref(answer);
	return status;
}
