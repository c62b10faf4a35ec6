/* SPDX-License-Identifier: Apache-2.0 */
#include "commission/act.h"
#include "client/clock.h"
#include "commission/judge.h"
#include "words/value.h"

#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The service stops the drive this long after the last keep-alive. */
#define HOLD_MS 300
#define BEAT_EVERY (HOLD_MS * DB_NS_PER_MS / 3)
/* How long the service may take for a call that needs no drive, and for one that does. */
#define CALL_MS 5000
#define DRIVE_MS 30000
/* Longest wait for the answer to a stop and for standstill; then this program continues. */
#define STAND_WITHIN (10 * DB_NS_PER_S)
/* A person at another place (the page) has to confirm the hold within this time, or the motion does
 * not begin. */
#define HELD_WITHIN DB_NS_PER_S
/* A position that does not change for this time counts as standstill. */
#define STANDS_FOR_MS 300

static void take_samples(void *data, json_t *parameters, const struct db_client_error *error,
                         bool more)
{
	struct db_commission_act *act = data;
	const json_t *reg = db_words_look_up(act->registers, "status");
	size_t i;
	const json_t *sample;

	(void)more;
	if (error)
		return;
	snprintf(act->token, sizeof(act->token), "%s", db_words_text(parameters, "token"));
	json_array_foreach(json_object_get(parameters, "samples"), i, sample)
	{
		const json_t *values = json_object_get(sample, "values");
		const json_t *status = json_object_get(values, "status");
		const json_t *position = json_object_get(values, "position");
		double ms = json_number_value(json_object_get(sample, "time_us")) / 1000;
		struct db_trial_sample taken = {
			.ms = ms,
			.position = json_number_value(position),
			.velocity = json_number_value(json_object_get(values, "velocity")),
			.online = db_words_has_bit(reg, status, "online"),
			.enabled = db_words_has_bit(reg, status, "enabled"),
			.moving = db_words_has_bit(reg, status, "moving"),
			.late_ms = (double)db_client_wall_us() / 1000 - ms,
		};

		act->latest = taken;
		taken.ms -= (double)act->wall_us / 1000;
		if (act->recording && taken.online && json_is_number(position))
			(void)db_trial_add(&act->trial, &taken);
	}
}

static void take_result(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct db_commission_act *act = data;
	const char *result = db_words_text(parameters, "result");

	(void)more;
	act->waiting = false;
	if (error) {
		result = db_words_text(error->parameters, "result");
		if (!result[0])
			result = strrchr(error->name, '.') ? strrchr(error->name, '.') + 1 :
			                                     error->name;
	}
	snprintf(act->result, sizeof(act->result), "%.63s", result);
}

static void take_stop(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct db_commission_act *act = data;

	(void)parameters;
	(void)error;
	(void)more;
	if (act->stops > 0)
		act->stops--;
}

/* On the connection of the motion, after it; and past it when the motion still waits for its
 * answer. */
static void stop(struct db_commission_act *act, const char *command)
{
	struct db_client *const ways[] = { act->client, act->stopper };

	for (size_t i = 0; i < (act->waiting ? 2 : 1); i++) {
		act->stops++;
		if (db_client_send(ways[i], "Run",
		                   json_pack("{s:s, s:s}", "drive", act->drive, "command", command),
		                   false, take_stop, act) != 0)
			act->stops--;
	}
}

bool db_commission_act_wait(struct db_commission_act *act, int fd, int timeout_ms)
{
	struct db_client *const clients[] = { act->client, act->stream, act->stopper };
	struct pollfd fds[5] = { { .fd = fd, .events = POLLIN },
		                 { .fd = act->asker->fd, .events = POLLIN } };

	for (size_t i = 0; i < 3; i++)
		fds[2 + i] = db_client_poll_fd(clients[i]);
	(void)poll(fds, 5, timeout_ms);
	for (size_t i = 0; i < 3; i++) {
		if (db_client_handle(clients[i]) != 0)
			act->lost = act->interrupted = true;
	}
	if (fds[1].revents != 0 && !act->asker->hear(act->asker->data))
		act->interrupted = true;
	return fds[0].revents != 0;
}

static void begin_trial(struct db_commission_act *act)
{
	struct db_trial_sample first = act->latest;

	db_trial_clear(&act->trial);
	act->wall_us = db_client_wall_us();
	act->recording = true;
	first.ms -= (double)act->wall_us / 1000;
	if (first.online)
		(void)db_trial_add(&act->trial, &first);
}

/* True if the position after this number of milliseconds at that velocity stays within the limits,
 * as far as they are known. */
static bool stays_inside(const struct db_commission_act *act, double velocity, double ms)
{
	double way = velocity * act->counts_per_velocity * ms / 1000;

	return !((velocity > 0 && act->latest.position + way > act->high) ||
	         (velocity < 0 && act->latest.position + way < act->low));
}

/* True once it stands: its status says so and its position has not changed lately. */
static bool wait_for_stand(struct db_commission_act *act)
{
	db_time deadline = db_client_now() + STAND_WITHIN;
	double position = act->latest.position;
	db_time since = db_client_now();

	while (db_client_now() < deadline && !act->lost) {
		(void)db_commission_act_wait(act, -1, 20);
		if (fabs(act->latest.position - position) > DB_TRIAL_DITHER || act->latest.moving) {
			position = act->latest.position;
			since = db_client_now();
		}
		if (act->stops == 0 && !act->waiting &&
		    db_client_now() - since >= STANDS_FOR_MS * DB_NS_PER_MS)
			return true;
	}
	return false;
}

/* Holds the motion until its time is over, it was refused, its limit is near or somebody
 * interrupts. */
static void hold(struct db_commission_act *act, const struct db_commission_action *action)
{
	db_time until = db_client_now() + action->ms * DB_NS_PER_MS;
	db_time beat_at = db_client_now();

	while (db_client_now() < until && !act->interrupted) {
		const char *token;

		(void)db_commission_act_wait(act, -1, 10);
		token = act->asker->hold(act->asker->data, act->token);
		if (!token) {
			act->interrupted = true;
			return;
		}
		if (!act->waiting && strcmp(act->result, "ok") != 0 &&
		    strcmp(act->result, "unproven") != 0)
			return;
		if (!stays_inside(act, action->velocity, 200))
			return;
		if (action->unheld || db_client_now() - beat_at < BEAT_EVERY)
			continue;
		beat_at = db_client_now();
		(void)db_client_tell(act->client, "Beat",
		                     json_pack("{s:s, s:s}", "drive", act->drive, "token", token));
	}
}

/* Over a new connection; the service there may have been restarted. */
static void stop_anew(const struct db_commission_act *act)
{
	struct db_client_error error = { .parameters = NULL };
	struct db_client *client = NULL;
	json_t *answer = NULL;

	if (db_client_open(act->socket, &client, &error) == 0)
		(void)db_client_call(
			client, "Run",
			json_pack("{s:s, s:s}", "drive", act->drive, "command", "stop"), CALL_MS,
			&answer, &error);
	json_decref(answer);
	db_client_error_clear(&error);
	db_client_close(client);
}

/*
 * Sends no more keep-alives for the motion, and waits until it stands by itself or
 * DB_COMMISSION_SILENT_MS are over. When the dead man's rule is tried (`feeds`), other calls feed
 * the watchdog, so that the watchdog does not stop the drive.
 */
static void wait_in_silence(struct db_commission_act *act, bool feeds)
{
	db_time until = db_client_now() + DB_COMMISSION_SILENT_MS * DB_NS_PER_MS;
	db_time since = db_client_now();
	db_time fed_at = since;
	double position = act->latest.position;

	while (db_client_now() < until && !act->interrupted &&
	       db_client_now() - since < STANDS_FOR_MS * DB_NS_PER_MS) {
		(void)db_commission_act_wait(act, -1, 20);
		if (!act->asker->hold(act->asker->data, act->token))
			act->interrupted = true;
		if (feeds && db_client_now() - fed_at >= BEAT_EVERY) {
			fed_at = db_client_now();
			(void)db_client_send(
				act->client, "Read",
				json_pack("{s:s, s:[s]}", "drive", act->drive, "names", "status"),
				false, NULL, NULL);
		}
		if (act->latest.position == position)
			continue;
		position = act->latest.position;
		since = db_client_now();
	}
}

/* The person at the asker has to confirm the hold in time, or nothing moves. */
static const char *wait_for_hold(struct db_commission_act *act)
{
	db_time until = db_client_now() + HELD_WITHIN;
	const char *token = act->asker->hold(act->asker->data, act->token);

	while (!token && !act->interrupted && db_client_now() < until) {
		(void)db_commission_act_wait(act, -1, 20);
		token = act->asker->hold(act->asker->data, act->token);
	}
	return act->interrupted ? NULL : token;
}

static void do_move(struct db_commission_act *act, const struct db_commission_action *action)
{
	bool silent = strcmp(action->ending, "silence") == 0;
	const char *token;
	json_t *call;

	/* Get a recent sample, and the service's current clock. */
	(void)db_commission_act_wait(act, -1, 50);
	act->asker->moves(act->asker->data, true, action->again);
	token = wait_for_hold(act);
	begin_trial(act);
	if (!token) {
		act->interrupted = true;
	} else if (!stays_inside(act, action->velocity, action->ms + 200)) {
		snprintf(act->result, sizeof(act->result), "limit");
	} else {
		call = json_pack("{s:s, s:s, s:{s:f}, s:s}", "drive", act->drive, "command",
		                 "move_velocity", "arguments", "target_velocity", action->velocity,
		                 "token", token);
		if (!action->unheld)
			(void)json_object_set_new(call, "hold_ms", json_integer(HOLD_MS));
		act->waiting = db_client_send(act->client, "Run", call, false, take_result, act) ==
		               0;
		hold(act, action);
		act->trial.ended_ms = (double)(db_client_wall_us() - act->wall_us) / 1000;
		if (silent)
			wait_in_silence(act, !action->unheld);
		stop(act, silent ? "stop" : action->ending);
		if (!wait_for_stand(act) && !act->lost)
			stop(act, "quick_stop");
		/* The service stops what a lost session held. */
		if (act->lost)
			stop_anew(act);
	}
	act->recording = false;
	act->asker->moves(act->asker->data, false, false);
}

static void do_run(struct db_commission_act *act, const struct db_commission_action *action,
                   struct db_commission_outcome *outcome)
{
	db_time begun = db_client_now();

	begin_trial(act);
	act->waiting = db_client_send(act->client, "Run",
	                              json_pack("{s:s, s:s, s:b}", "drive", act->drive, "command",
	                                        action->command, "until_end", true),
	                              false, take_result, act) == 0;
	while (act->waiting && !act->interrupted &&
	       db_client_now() - begun < DRIVE_MS * DB_NS_PER_MS)
		(void)db_commission_act_wait(act, -1, 20);
	act->recording = false;
	outcome->took_ms = (double)(db_client_now() - begun) / DB_NS_PER_MS;
}

/* --- reading ---------------------------------------------------------------------------------- */

json_t *db_commission_act_call(struct db_commission_act *act, const char *method,
                               json_t *parameters)
{
	struct db_client_error error = { .parameters = NULL };
	json_t *answer = NULL;

	if (db_client_call(act->client, method, parameters, CALL_MS, &answer, &error) != 0 &&
	    strcmp(error.name, DB_CLIENT_LOST) == 0)
		act->lost = act->interrupted = true;
	db_client_error_clear(&error);
	return answer;
}

static json_t *read_names(struct db_commission_act *act, json_t *names)
{
	json_t *answer = db_commission_act_call(
		act, "Read", json_pack("{s:s, s:o}", "drive", act->drive, "names", names));
	json_t *values = json_incref(json_object_get(answer, "values"));

	json_decref(answer);
	return values ? values : json_object();
}

/* Samples come only with new data of the drive: whether it is online has to be asked. */
static bool is_online(struct db_commission_act *act)
{
	json_t *values = read_names(act, json_pack("[s]", "status"));
	bool online = db_words_has_bit(db_words_look_up(act->registers, "status"),
	                               json_object_get(values, "status"), "online");

	json_decref(values);
	return online;
}

static void do_watch(struct db_commission_act *act, const struct db_commission_action *action)
{
	db_time until = db_client_now() + action->ms * DB_NS_PER_MS;
	bool wanted = action->until == DB_COMMISSION_ONLINE;
	bool seen = false;

	begin_trial(act);
	while (db_client_now() < until && !act->interrupted && !seen) {
		(void)db_commission_act_wait(act, -1, 100);
		seen = action->until != DB_COMMISSION_TIME && is_online(act) == wanted;
	}
	act->recording = false;
	json_decref(act->values);
	act->values = json_pack("{s:b}", "seen", seen);
}

static json_t *read_parameters(struct db_commission_act *act)
{
	json_t *names = json_array();
	size_t i;
	const json_t *reg;

	json_array_foreach(act->registers, i, reg)
	{
		if (json_is_true(json_object_get(reg, "parameter")) &&
		    json_is_true(json_object_get(reg, "writable")))
			(void)json_array_append(names, json_object_get(reg, "name"));
	}
	/* An empty list of names would read all process data. */
	if (json_array_size(names) > 0)
		return read_names(act, names);
	json_decref(names);
	return json_object();
}

/* True if an event of that name occurred for this drive since its configuration is in force. */
static bool was_told(const struct db_commission_act *act, const json_t *events, const char *name)
{
	size_t i;
	const json_t *event;

	json_array_foreach(events, i, event)
	{
		if (strcmp(db_words_text(event, "name"), name) == 0 &&
		    strcmp(db_words_text(event, "drive"), act->drive) == 0 &&
		    json_integer_value(json_object_get(event, "time_us")) >= act->since_us)
			return true;
	}
	return false;
}

static void do_read(struct db_commission_act *act)
{
	static const char *const bits[] = { "online", "enabled",     "homed",
		                            "moving", "origin_lost", "params_valid" };
	json_t *values = read_names(act, json_array());
	json_t *counters = read_names(act, json_pack("[s, s, s, s, s, s, s, s]", "identity",
	                                             "requests", "answers", "timeouts",
	                                             "round_trip_mean_us", "round_trip_max_us",
	                                             "learnt_gap_us", "learnt_latency_ms"));
	json_t *answer = db_commission_act_call(act, "Troubles",
	                                        json_pack("{s:[s]}", "drives", act->drive));
	json_t *log = db_commission_act_call(act, "Events", NULL);
	const json_t *trouble = json_array_get(json_object_get(answer, "drives"), 0);
	const json_t *status = json_object_get(values, "status");
	const json_t *reg = db_words_look_up(act->registers, "status");

	(void)json_object_update(values, counters);
	for (size_t i = 0; i < sizeof(bits) / sizeof(bits[0]); i++)
		(void)json_object_set_new(values, bits[i],
		                          json_boolean(db_words_has_bit(reg, status, bits[i])));
	(void)json_object_set_new(values, "trouble", json_string(db_words_text(trouble, "cause")));
	(void)json_object_set_new(values, "advice", json_string(db_words_text(trouble, "advice")));
	(void)json_object_set_new(values, "parameters", read_parameters(act));
	(void)json_object_set_new(
		values, "late",
		json_boolean(was_told(act, json_object_get(log, "events"), "drive-late")));
	(void)json_object_set_new(
		values, "deaf",
		json_boolean(was_told(act, json_object_get(log, "events"), "drive-deaf")));
	json_decref(log);
	json_decref(counters);
	json_decref(answer);
	json_decref(act->values);
	act->values = values;
}

void db_commission_act_do(struct db_commission_act *act, const struct db_commission_action *action,
                          struct db_commission_outcome *outcome)
{
	*outcome = (struct db_commission_outcome){ .trial = &act->trial, .result = act->result };
	act->result[0] = '\0';
	switch (action->kind) {
	case DB_COMMISSION_READ:
		do_read(act);
		break;
	case DB_COMMISSION_RUN:
		do_run(act, action, outcome);
		break;
	case DB_COMMISSION_MOVE:
		do_move(act, action);
		break;
	case DB_COMMISSION_WATCH:
		do_watch(act, action);
		break;
	case DB_COMMISSION_ASK:
		break;
	}
	outcome->values = act->values;
}

static void introduce(struct db_commission_act *act, struct db_client *client)
{
	if (act->user)
		(void)db_client_send(client, "Introduce", json_pack("{s:s}", "user", act->user),
		                     false, NULL, NULL);
}

int db_commission_act_open(struct db_commission_act *act, struct db_client_error *error)
{
	act->trial.ended_ms = -1;
	if (db_client_open(act->socket, &act->client, error) != 0 ||
	    db_client_open(act->socket, &act->stopper, error) != 0 ||
	    db_client_open(act->socket, &act->stream, error) != 0)
		return -1;
	introduce(act, act->client);
	introduce(act, act->stopper);
	if (db_client_send(act->stream, "Subscribe",
	                   json_pack("{s:[s], s:[s, s, s], s:i}", "drives", act->drive, "names",
	                             "position", "velocity", "status", "interval_ms", 0),
	                   true, take_samples, act) == 0)
		return 0;
	db_client_error_set(error, DB_CLIENT_LOST, "the service has closed the connection");
	return -1;
}

void db_commission_act_close(struct db_commission_act *act)
{
	db_client_close(act->stream);
	db_client_close(act->stopper);
	db_client_close(act->client);
	db_trial_clear(&act->trial);
	json_decref(act->values);
}
