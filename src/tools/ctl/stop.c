/* SPDX-License-Identifier: Apache-2.0 */
#include "client/clock.h"
#include "ctl/ctl_private.h"
#include "ctl/say.h"
#include "words/value.h"

#include <poll.h>
#include <stdio.h>
#include <string.h>

/* How long the service waits for the drives, and how long this program waits for the service: it
 * may be restarting, or busy for a moment. */
#define DRIVES_MS 5000
#define SERVICE_MS (DRIVES_MS + 1000)
#define AGAIN_MS 5

int db_ctl_stop_drive(const struct db_ctl *ctl, const char *drive, struct db_client_error *error)
{
	struct db_client *client = NULL;
	json_t *answer = NULL;
	int failed = db_client_open(ctl->socket, &client, error);

	if (failed == 0)
		failed = db_client_call(client, "Run",
		                        json_pack("{s:s, s:s}", "drive", drive, "command", "stop"),
		                        DB_CTL_TIMEOUT_MS, &answer, error);
	json_decref(answer);
	db_client_close(client);
	return failed;
}

/* --- the command ------------------------------------------------------------------------------ */

/* A Stop whose answers arrive one by one. */
struct stopping {
	const struct db_ctl *ctl;
	const char *command;
	json_t *drives; /* by name; empty: all */
	db_time warn_at;
	db_time deadline;
	bool ended;
	unsigned confirmed;
	unsigned unknown; /* number of names that no drive has */
	unsigned unconfirmed;
	struct db_client_error error; /* of the call, or of the connection */
};

static void print_stopped(struct stopping *stopping, const json_t *one)
{
	const char *result = db_words_text(one, "result");
	bool confirmed = strcmp(result, "ok") == 0;
	bool unknown = strcmp(result, "no_such_drive") == 0;
	char drive[64];
	char reason[256];
	char room[DB_WORDS_TEXT_MAX];
	json_t *object;

	stopping->confirmed += confirmed;
	stopping->unknown += unknown;
	stopping->unconfirmed += !confirmed && !unknown;
	if (stopping->ctl->json) {
		object = json_pack("{s:s, s:s, s:s, s:s*}", "drive", db_words_text(one, "drive"),
		                   "command", stopping->command, "result", result, "reason",
		                   json_string_value(json_object_get(one, "reason")));
		db_ctl_print_json(object);
		json_decref(object);
		return;
	}
	snprintf(drive, sizeof(drive), "%s", db_words_text(one, "drive"));
	snprintf(reason, sizeof(reason), "%s", db_words_text(one, "reason"));
	db_words_clean(drive);
	db_words_clean(reason);
	printf("%s: %s: %s%s%s\n", drive, stopping->command,
	       confirmed ? db_ctl_say_name("ok") : db_ctl_say("NOT CONFIRMED"),
	       confirmed ? "" : ": ", db_ctl_translate(reason, room));
	(void)fflush(stdout);
}

static void take_stopped(void *data, json_t *parameters, const struct db_client_error *error,
                         bool more)
{
	struct stopping *stopping = data;
	const json_t *one;
	size_t i;

	stopping->ended = !more;
	if (error)
		db_client_error_set(&stopping->error, error->name, "%s", error->text);
	else if (!json_is_array(json_object_get(parameters, "stopped")))
		db_client_error_set(&stopping->error, DB_CLIENT_BAD_ANSWER,
		                    "the service does not say which drives it stops");
	json_array_foreach(json_object_get(parameters, "stopped"), i, one)
		print_stopped(stopping, one);
}

void db_ctl_stop_warn(const struct db_ctl *ctl)
{
	if (!ctl->json)
		fprintf(stderr, "drivebridgectl: %s\n",
		        db_ctl_say("not confirmed yet; if somebody is in danger use the emergency "
		                   "stop"));
}

/* One attempt, until it ends, with or without success. */
static void stop_over(struct stopping *stopping, struct db_client *client)
{
	json_t *call = json_pack("{s:O, s:s, s:i}", "drives", stopping->drives, "command",
	                         stopping->command, "wait_ms", DRIVES_MS);

	if (db_client_send(client, "Stop", call, true, take_stopped, stopping) != 0)
		db_client_error_set(&stopping->error, DB_CLIENT_LOST,
		                    "the service has closed the connection");
	while (!stopping->ended && stopping->error.name[0] == '\0') {
		struct pollfd fd = db_client_poll_fd(client);
		db_time now = db_client_now();
		db_time due = stopping->warn_at < stopping->deadline ? stopping->warn_at :
		                                                       stopping->deadline;

		if (now >= stopping->deadline) {
			db_client_error_set(&stopping->error, DB_CLIENT_TIMEOUT,
			                    "the service does not answer");
			return;
		}
		if (now >= stopping->warn_at) {
			stopping->warn_at = DB_TIME_NEVER;
			db_ctl_stop_warn(stopping->ctl);
			continue;
		}
		(void)poll(&fd, 1, (int)((due - now + DB_NS_PER_MS - 1) / DB_NS_PER_MS));
		(void)db_client_handle(client);
	}
}

/* The service was busy or went away: another attempt may succeed at once. */
static bool is_passing(const struct stopping *stopping, bool reached)
{
	const char *name = stopping->error.name;

	return strcmp(name, DB_CLIENT_SERVICE "Busy") == 0 || strcmp(name, DB_CLIENT_LOST) == 0 ||
	       (reached && strcmp(name, DB_CLIENT_UNREACHABLE) == 0);
}

static void stop_until_answered(struct stopping *stopping)
{
	bool reached = false;

	for (;;) {
		struct db_client *client = NULL;

		db_client_error_clear(&stopping->error);
		stopping->ended = false;
		stopping->confirmed = stopping->unknown = stopping->unconfirmed = 0;
		if (db_client_open(stopping->ctl->socket, &client, &stopping->error) == 0) {
			reached = true;
			stop_over(stopping, client);
		}
		db_client_close(client);
		if (!is_passing(stopping, reached) || db_client_now() >= stopping->deadline)
			return;
		(void)poll(NULL, 0, AGAIN_MS);
		if (db_client_now() >= stopping->warn_at) {
			stopping->warn_at = DB_TIME_NEVER;
			db_ctl_stop_warn(stopping->ctl);
		}
	}
}

static enum db_ctl_status judge(const struct stopping *stopping)
{
	if (stopping->error.name[0] != '\0') {
		enum db_ctl_status status = db_ctl_fail(stopping->ctl, &stopping->error);

		(void)db_ctl_complain(stopping->ctl, status, "io.drivebridge.Client.NotConfirmed",
		                      "the stop is not confirmed: use the emergency stop");
		return status;
	}
	/* A drive without a result counts as unconfirmed. */
	if (stopping->unconfirmed > 0 ||
	    stopping->confirmed + stopping->unknown < json_array_size(stopping->drives))
		return db_ctl_complain(stopping->ctl, DB_CTL_NO,
		                       "io.drivebridge.Client.NotConfirmed",
		                       "not every drive has confirmed that it stops: use the "
		                       "emergency stop");
	return stopping->unknown > 0 ? DB_CTL_USAGE : DB_CTL_OK;
}

enum db_ctl_status db_ctl_stop(struct db_ctl *ctl, int count, char **arguments)
{
	db_time now = db_client_now();
	struct stopping stopping = {
		.ctl = ctl,
		.command = ctl->disable ? "disable" :
		           ctl->quick   ? "quick_stop" :
		                          "stop",
		.drives = json_array(),
		.warn_at = now + DB_CTL_STOP_WARN_MS * DB_NS_PER_MS,
		.deadline = now + SERVICE_MS * DB_NS_PER_MS,
	};
	enum db_ctl_status status;

	for (int i = 0; i < count; i++)
		(void)json_array_append_new(stopping.drives, json_string(arguments[i]));
	stop_until_answered(&stopping);
	status = judge(&stopping);
	db_client_error_clear(&stopping.error);
	json_decref(stopping.drives);
	return status;
}
