/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Two connections: the first holds the drive's motion and sends its keep-alive while the key is
 * held; the second stops the drive when the first waits for an answer, and reads the drive and the
 * service's clock. When this program hangs or ends, or its connection is lost, the service stops
 * the held motion.
 */
#include "client/clock.h"
#include "ctl/ctl_private.h"
#include "ctl/hold.h"
#include "ctl/plant.h"
#include "ctl/say.h"
#include "ctl/terminal.h"
#include "ctl/units.h"
#include "words/value.h"

#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* The service stops the drive this long after the last keep-alive. */
#define HOLD_MS 300
#define BEAT_EVERY (HOLD_MS * DB_NS_PER_MS / 3)
#define READ_EVERY (100 * DB_NS_PER_MS)
/* Longest wait for the confirmation of a stop; then this program ends without it. */
#define STOP_WITHIN (3 * DB_NS_PER_S)

struct jog {
	struct db_ctl *ctl;
	const char *drive;
	json_t *registers;
	double velocity;
	struct db_client *stopper;
	struct db_ctl_hold hold;
	int told;       /* the direction last sent to the drive */
	unsigned moves; /* moves without an answer */
	unsigned stops; /* stops without an answer */
	bool confirmed; /* at least one stop since the last move */
	bool reading;
	db_time read_at;
	bool asking;    /* the service's clock was asked for */
	char token[64]; /* last token sent; "": none */
	db_time beat_at;
	json_t *values;
	char line[768];    /* last line printed */
	char trouble[512]; /* the service's last objection */
};

/* Prints the position when the line has changed. */
static void print_line(struct jog *jog)
{
	char position[DB_WORDS_VALUE_MAX];
	char velocity[DB_WORDS_VALUE_MAX];
	char state[DB_WORDS_VALUE_MAX];
	char line[sizeof(jog->line)];
	char room[DB_WORDS_TEXT_MAX];
	const char *words;

	if (jog->ctl->json || !db_ctl_terminal_takes_output())
		return;
	db_words_write_value(db_words_look_up(jog->registers, "position"),
	                     json_object_get(jog->values, "position"), position, sizeof(position));
	db_words_write_value(db_words_look_up(jog->registers, "velocity"),
	                     json_object_get(jog->values, "velocity"), velocity, sizeof(velocity));
	db_words_write_value(db_words_look_up(jog->registers, "axis_state"),
	                     json_object_get(jog->values, "axis_state"), state, sizeof(state));
	words = jog->trouble[0] ? db_ctl_translate(jog->trouble, room) : db_ctl_say_name(state);
	snprintf(line, sizeof(line), db_ctl_say("%s %s %s  at %.40s  %.40s  %.*s"),
	         jog->told < 0 ? "<=" : "  ", jog->drive, jog->told > 0 ? "=>" : "  ", position,
	         velocity, db_words_fit(words, 160), words);
	if (strcmp(line, jog->line) == 0)
		return;
	memcpy(jog->line, line, sizeof(line));
	printf("\r%s\033[K", line);
	(void)fflush(stdout);
}

static void print_result(const struct jog *jog, const char *command, const json_t *parameters,
                         const struct db_client_error *error)
{
	json_t *object;

	if (!jog->ctl->json)
		return;
	object = json_pack("{s:s, s:s, s:s?, s:s?}", "drive", jog->drive, "command", command,
	                   "result", error ? NULL : db_words_text(parameters, "result"), "error",
	                   error ? error->name : NULL);
	db_ctl_print_json(object);
	json_decref(object);
}

static void take_stop(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct jog *jog = data;

	(void)more;
	jog->stops--;
	jog->confirmed = jog->confirmed || !error;
	if (error)
		snprintf(jog->trouble, sizeof(jog->trouble), "%s", error->text);
	print_result(jog, "stop", parameters, error);
}

static void send_stop(struct jog *jog, struct db_client *client)
{
	json_t *parameters = json_pack("{s:s, s:s}", "drive", jog->drive, "command", "stop");

	jog->stops++;
	if (db_client_send(client, "Run", parameters, false, take_stop, jog) != 0)
		jog->stops--;
}

/* On the connection of the moves, so that it follows the last move; and on the other one when a
 * move still waits. */
static void stop(struct jog *jog)
{
	jog->told = 0;
	jog->confirmed = false;
	send_stop(jog, jog->ctl->client);
	if (jog->moves > 0)
		send_stop(jog, jog->stopper);
}

static void take_move(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct jog *jog = data;

	(void)more;
	jog->moves--;
	print_result(jog, "move_velocity", parameters, error);
	if (!error)
		return;
	snprintf(jog->trouble, sizeof(jog->trouble), "%s", error->text);
	db_words_clean(jog->trouble);
	db_ctl_hold_cancel(&jog->hold);
	if (jog->told != 0 && db_client_error_may_move(error))
		stop(jog);
	jog->told = 0;
}

static void move(struct jog *jog, int direction)
{
	json_t *parameters = json_pack("{s:s, s:s, s:{s:f}, s:i, s:s}", "drive", jog->drive,
	                               "command", "move_velocity", "arguments", "target_velocity",
	                               direction * jog->velocity, "hold_ms", HOLD_MS, "token",
	                               jog->token);

	jog->told = direction;
	jog->beat_at = db_client_now();
	jog->trouble[0] = '\0';
	jog->moves++;
	if (db_client_send(jog->ctl->client, "Run", parameters, false, take_move, jog) != 0)
		jog->moves--;
}

static void take_token(void *data, json_t *parameters, const struct db_client_error *error,
                       bool more)
{
	struct jog *jog = data;

	(void)more;
	jog->asking = false;
	if (error)
		snprintf(jog->trouble, sizeof(jog->trouble), "%s", error->text);
	else
		snprintf(jog->token, sizeof(jog->token), "%s", db_words_text(parameters, "token"));
}

static void take_values(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct jog *jog = data;

	(void)more;
	jog->reading = false;
	json_decref(jog->values);
	jog->values = error ? NULL : json_incref(json_object_get(parameters, "values"));
}

/* False when it is time to end: an ending key, or the terminal is closed. */
static bool read_keys(struct jog *jog, const struct pollfd *terminal)
{
	char bytes[256];
	size_t at = 0;
	ssize_t count;

	if (terminal->revents == 0)
		return true;
	count = read(STDIN_FILENO, bytes, sizeof(bytes));
	if (count <= 0)
		return false;
	for (;;) {
		switch (db_ctl_terminal_next_key(bytes, (size_t)count, &at)) {
		case DB_CTL_KEY_NONE:
			return (terminal->revents & (POLLHUP | POLLERR)) == 0;
		case DB_CTL_KEY_QUIT:
			return false;
		case DB_CTL_KEY_FORWARD:
			db_ctl_hold_press(&jog->hold, 1, db_client_now());
			break;
		case DB_CTL_KEY_BACKWARD:
			db_ctl_hold_press(&jog->hold, -1, db_client_now());
			break;
		case DB_CTL_KEY_OTHER:
			db_ctl_hold_cancel(&jog->hold);
			break;
		}
	}
}

/* Runs until the user ends it. False when a connection is lost. */
static bool run_jog(struct jog *jog, int signals)
{
	struct pollfd fds[] = {
		{ .fd = STDIN_FILENO, .events = POLLIN },
		{ .fd = signals, .events = POLLIN },
		{ .fd = -1 },
		{ .fd = -1 },
	};
	int signal_number = 0;
	int direction;
	db_time now;

	while (signal_number == 0 || signal_number == SIGWINCH) {
		fds[2] = db_client_poll_fd(jog->ctl->client);
		fds[3] = db_client_poll_fd(jog->stopper);
		/* Short enough for the next deadline: a key's release or the next reading. */
		(void)poll(fds, sizeof(fds) / sizeof(fds[0]), 20);
		if (db_client_handle(jog->ctl->client) != 0 || db_client_handle(jog->stopper) != 0)
			return false;
		signal_number = db_ctl_signals_read(signals);
		if (!read_keys(jog, &fds[0]))
			return true;
		now = db_client_now();
		direction = db_ctl_hold_direction(&jog->hold, now);
		if (direction == 0 && jog->told != 0)
			stop(jog);
		else if (direction != jog->told && jog->moves == 0 && jog->stops == 0 &&
		         jog->token[0] != '\0')
			move(jog, direction);
		if (jog->told != 0 && now - jog->beat_at >= BEAT_EVERY) {
			/* Does not wait for an answer: the service takes a keep-alive after the
			 * move before the move is confirmed. */
			jog->beat_at = now;
			(void)db_client_tell(
				jog->ctl->client, "Beat",
				json_pack("{s:s, s:s}", "drive", jog->drive, "token", jog->token));
		}
		if (!jog->reading && now - jog->read_at >= READ_EVERY) {
			jog->read_at = now;
			jog->reading = db_client_send(
					       jog->stopper, "Read",
					       json_pack("{s:s, s:o}", "drive", jog->drive, "names",
			                                 db_ctl_process_names(jog->registers)),
					       false, take_values, jog) == 0;
			if (!jog->asking)
				jog->asking = db_client_send(jog->stopper, "Clock", NULL, false,
				                             take_token, jog) == 0;
		}
		print_line(jog);
	}
	return true;
}

/* Waits until the drive stands, or prints that this is not known. */
static enum db_ctl_status end_jog(struct jog *jog, bool connected)
{
	struct db_client_error error = { .parameters = NULL };
	db_time deadline = db_client_now() + STOP_WITHIN;
	enum db_ctl_status status = DB_CTL_OK;

	if (connected && (jog->told != 0 || jog->moves > 0))
		stop(jog);
	while (connected && jog->stops > 0 && !jog->confirmed && db_client_now() < deadline) {
		struct pollfd fds[] = { db_client_poll_fd(jog->ctl->client),
			                db_client_poll_fd(jog->stopper) };

		(void)poll(fds, 2, 100);
		connected = db_client_handle(jog->ctl->client) == 0 &&
		            db_client_handle(jog->stopper) == 0;
	}
	if (connected && (jog->stops == 0 || jog->confirmed))
		return DB_CTL_OK;
	/* Repeat over a new connection; the service there may have been restarted. */
	if (db_ctl_stop_drive(jog->ctl, jog->drive, &error) == 0)
		status = db_ctl_complain(
			jog->ctl, DB_CTL_UNREACHABLE, DB_CLIENT_LOST,
			"the connection was lost; %s has been told to stop over a new one",
			jog->drive);
	else
		status = db_ctl_complain(
			jog->ctl, DB_CTL_UNREACHABLE, DB_CLIENT_LOST,
			"%s could not be told to stop (%s): its watchdog is to stop it", jog->drive,
			error.text);
	db_client_error_clear(&error);
	return status;
}

/* A tenth of the maximum if none is given. */
static enum db_ctl_status choose_velocity(struct jog *jog)
{
	const json_t *reg = db_words_look_up(jog->registers, "target_velocity");
	const json_t *max = json_object_get(reg, "max");
	char problem[256] = "";
	json_t *value;

	if (!jog->ctl->velocity) {
		jog->velocity = json_number_value(max) / 10;
		return json_is_number(max) ?
		               DB_CTL_OK :
		               db_ctl_complain(jog->ctl, DB_CTL_USAGE, DB_CLIENT_SERVICE "BadValue",
		                               "%s has no max-velocity in the configuration: say "
		                               "--velocity V, in %s",
		                               jog->drive, db_words_text(reg, "unit"));
	}
	value = db_ctl_read_quantity(jog->ctl, jog->drive, jog->registers, reg, jog->ctl->velocity,
	                             problem, sizeof(problem));
	jog->velocity = fabs(json_number_value(value));
	json_decref(value);
	return value ? DB_CTL_OK :
	               db_ctl_complain(jog->ctl, DB_CTL_USAGE, DB_CLIENT_SERVICE "BadValue",
	                               "--velocity: %s", problem);
}

/* Print in advance what the service would refuse. */
static enum db_ctl_status check_drive(struct jog *jog)
{
	enum db_ctl_status status;
	struct db_ctl_judgement judgement;
	struct db_client_error error = { .parameters = NULL };
	json_t *troubles = NULL;
	json_t *answer = db_ctl_call(jog->ctl, "Read",
	                             json_pack("{s:s, s:o}", "drive", jog->drive, "names",
	                                       db_ctl_process_names(jog->registers)),
	                             DB_CTL_TIMEOUT_MS, &status);
	char state[DB_WORDS_VALUE_MAX];

	if (!answer)
		return status;
	jog->values = json_incref(json_object_get(answer, "values"));
	json_decref(answer);
	/* An older service has no such call: it refuses the move itself. */
	(void)db_client_call(jog->ctl->client, "Troubles",
	                     json_pack("{s:[s]}", "drives", jog->drive), DB_CTL_TIMEOUT_MS,
	                     &troubles, &error);
	db_ctl_judge(json_array_get(json_object_get(troubles, "drives"), 0), &judgement);
	json_decref(troubles);
	db_client_error_clear(&error);
	db_words_write_value(db_words_look_up(jog->registers, "axis_state"),
	                     json_object_get(jog->values, "axis_state"), state, sizeof(state));
	if (judgement.need == DB_CLIENT_ACT)
		return db_ctl_complain(jog->ctl, DB_CTL_NO, DB_CLIENT_SERVICE "Refused",
		                       "%s: %s: %s", jog->drive, judgement.why, judgement.next);
	if (strcmp(state, "Disabled") == 0)
		return db_ctl_complain(jog->ctl, DB_CTL_NO, DB_CLIENT_SERVICE "Refused",
		                       "%s is disabled; drivebridgectl run %s enable", jog->drive,
		                       jog->drive);
	return DB_CTL_OK;
}

enum db_ctl_status db_ctl_jog(struct db_ctl *ctl, int count, char **arguments)
{
	struct jog jog = { .ctl = ctl, .drive = arguments[0] };
	const json_t *drive = db_ctl_find_drive(ctl, arguments[0]);
	struct db_client_error error = { .parameters = NULL };
	struct db_ctl_terminal terminal = { .open = false };
	enum db_ctl_status status = DB_CTL_USAGE;
	int signals = -1;
	bool connected;

	(void)count;
	if (drive)
		jog.registers = db_ctl_read_registers(ctl, arguments[0], &status);
	if (status == DB_CTL_OK)
		status = choose_velocity(&jog);
	if (status == DB_CTL_OK)
		status = check_drive(&jog);
	if (status == DB_CTL_OK && db_client_open(ctl->socket, &jog.stopper, &error) != 0)
		status = db_ctl_fail(ctl, &error);
	if (status == DB_CTL_OK) {
		signals = db_ctl_signals_open();
		if (signals < 0 || !db_ctl_terminal_open(&terminal, false))
			status = db_ctl_complain(ctl, DB_CTL_USAGE,
			                         "io.drivebridge.Client.NoTerminal",
			                         "jog needs a terminal, for its keys");
	}
	if (status == DB_CTL_OK) {
		if (!ctl->json)
			db_ctl_say_line(
				stdout,
				"%s at %.10g %s: hold an arrow key to move, release it to stop, q "
				"ends",
				jog.drive, jog.velocity,
				db_words_text(db_words_look_up(jog.registers, "target_velocity"),
			                      "unit"));
		connected = run_jog(&jog, signals);
		/* First the drive, then the terminal. */
		status = end_jog(&jog, connected);
		print_line(&jog);
		if (!ctl->json && db_ctl_terminal_takes_output())
			puts("");
		db_ctl_terminal_close(&terminal);
	}
	if (signals >= 0)
		(void)close(signals);
	db_client_close(jog.stopper);
	db_client_error_clear(&error);
	json_decref(jog.values);
	json_decref(jog.registers);
	/* Late answers to the stops would write into this function's memory. */
	db_client_close(ctl->client);
	ctl->client = NULL;
	return status;
}
