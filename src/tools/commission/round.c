/* SPDX-License-Identifier: Apache-2.0 */
#include "commission/round.h"
#include "commission/judge.h"
#include "commission/section.h"
#include "words/value.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Default velocity of a trial motion: counts/s or Hz, and rpm. */
#define SLOW 1600.0
#define SLOW_RPM 60.0
#define MOTION_S 1.5

/* --- what is known before --------------------------------------------------------------------- */

static void learn_facts(struct db_commission_round *round, const struct db_commission_order *order)
{
	struct db_commission_facts facts = {
		.family = db_words_text(round->bus, "protocol"),
		.unit_name = db_words_text(round->drive, "unit_name"),
		.drive_keys = round->drive_keys,
		.bus_keys = round->bus_keys,
		.cycle_ms = (unsigned)json_integer_value(json_object_get(round->bus, "cycle_ms")),
		.ms = (unsigned)((order->seconds > 0 ? order->seconds : MOTION_S) * 1000),
	};
	const json_t *velocity = db_words_look_up(round->registers, "target_velocity");
	double slow = strcmp(facts.family, "servo-can") == 0 ? SLOW_RPM : SLOW;

	if (facts.unit_name[0] == '\0')
		facts.unit_name = "counts";
	facts.max_velocity = json_number_value(json_object_get(velocity, "max"));
	facts.velocity = order->velocity > 0    ? order->velocity :
	                 facts.max_velocity > 0 ? fmin(slow, facts.max_velocity / 10) :
	                                          slow;
	db_commission_open(&round->engine, &facts);
}

static int learn_drive(struct db_commission_round *round, const struct db_commission_order *order,
                       struct db_client_error *error)
{
	json_t *answer;

	round->description = db_commission_act_call(&round->act, "Describe", NULL);
	round->drive = db_words_look_up(json_object_get(round->description, "drives"),
	                                order->drive);
	round->bus = db_words_look_up(json_object_get(round->description, "buses"),
	                              db_words_text(round->drive, "bus"));
	answer = db_commission_act_call(&round->act, "Registers",
	                                json_pack("{s:s}", "drive", order->drive));
	round->registers = json_incref(json_object_get(answer, "registers"));
	json_decref(answer);
	if (round->drive && round->bus && round->registers)
		return 0;
	db_client_error_set(error, DB_CLIENT_SERVICE "NoSuchDrive",
	                    "the service does not say anything of a drive \"%s\"", order->drive);
	return -1;
}

/* --- the round -------------------------------------------------------------------------------- */

/* False: the round ends. */
static bool do_step(struct db_commission_round *round, size_t index)
{
	const struct db_commission_step *step = &db_commission_list[index];
	const struct db_commission_asker *asker = round->asker;
	struct db_commission_outcome outcome = { .answer = NULL };
	struct db_commission_action action;
	const char *identity;

	asker->begin(asker->data, step);
	db_commission_begin(&round->engine, index);
	while (db_commission_next(&round->engine, &outcome, &action)) {
		if (action.kind == DB_COMMISSION_ASK)
			outcome = (struct db_commission_outcome){
				.answer = asker->ask(asker->data, &round->act, &action)
			};
		else
			db_commission_act_do(&round->act, &action, &outcome);
		round->touched = round->touched || action.kind == DB_COMMISSION_RUN;
		identity = db_words_text(outcome.values, "identity");
		if (identity[0])
			snprintf(round->identity, sizeof(round->identity), "%s", identity);
		if (round->act.interrupted)
			return false;
	}
	if (!db_words_has_text(round->done, step->name))
		(void)json_array_append_new(round->done, json_string(step->name));
	return asker->end(asker->data, step, round->engine.verdicts, round->done);
}

void db_commission_round_run(struct db_commission_round *round, int only)
{
	struct db_commission_action off = { .kind = DB_COMMISSION_RUN, .command = "disable" };
	struct db_commission_outcome outcome;
	bool goes_on = true;
	bool interrupted;

	for (int i = 0; db_commission_list[i].name && goes_on; i++) {
		if (only >= 0 ? i == only :
		                !db_commission_list[i].chosen &&
		                        !db_words_has_text(round->done, db_commission_list[i].name))
			goes_on = do_step(round, (size_t)i);
	}
	/* At the end, also after an interruption, the drive on the bench has no power. */
	if (round->touched && !round->act.lost) {
		interrupted = round->act.interrupted;
		round->act.interrupted = false;
		db_commission_act_do(&round->act, &off, &outcome);
		round->act.interrupted = round->act.interrupted || interrupted;
	}
	db_commission_fill(&round->engine);
}

struct db_commission_report db_commission_round_report(const struct db_commission_round *round)
{
	return (struct db_commission_report){
		.drive = db_words_text(round->drive, "name"),
		.bus = db_words_text(round->drive, "bus"),
		.family = db_words_text(round->bus, "protocol"),
		.identity = round->identity,
		.drive_keys = round->drive_keys,
		.bus_keys = round->bus_keys,
		.problem = round->problem,
		.verdicts = round->engine.verdicts,
		.done = round->done,
	};
}

/* --- life ------------------------------------------------------------------------------------- */

int db_commission_round_open(struct db_commission_round *round,
                             const struct db_commission_order *order,
                             const struct db_commission_asker *asker, struct db_client_error *error)
{
	const char *path;
	const char *low;
	const char *high;
	double unit;

	*round = (struct db_commission_round){
		.asker = asker,
		.done = json_array(),
		.act = { .socket = order->socket,
		         .user = order->user,
		         .drive = order->drive,
		         .asker = asker },
	};
	if (db_commission_act_open(&round->act, error) != 0 ||
	    learn_drive(round, order, error) != 0)
		return -1;
	round->act.registers = round->registers;
	round->act.since_us = json_integer_value(
		json_object_get(round->description, "configuration_since_us"));
	path = db_words_text(round->description, "configuration");
	round->drive_keys = db_commission_section_read(path, "drive",
	                                               db_words_text(round->drive, "name"),
	                                               round->problem, sizeof(round->problem));
	if (round->drive_keys)
		round->bus_keys = db_commission_section_read(
			path, "bus", db_words_text(round->drive, "bus"), round->problem,
			sizeof(round->problem));
	if (round->drive_keys && round->bus_keys)
		round->problem[0] = '\0';
	learn_facts(round, order);
	/* The configured position limits, and the largest velocity. */
	low = db_commission_setting(&round->engine, "drive", "min-position");
	high = db_commission_setting(&round->engine, "drive", "max-position");
	unit = db_commission_number(&round->engine, "drive", "counts-per-unit");
	round->act.low = low[0] ? strtod(low, NULL) * unit : -INFINITY;
	round->act.high = high[0] ? strtod(high, NULL) * unit : INFINITY;
	round->act.counts_per_velocity =
		strcmp(round->engine.facts.family, "servo-can") != 0 ?
			1 :
			db_commission_number(&round->engine, "drive", "counts-per-turn") / 60;
	return 0;
}

void db_commission_round_close(struct db_commission_round *round)
{
	db_commission_act_close(&round->act);
	db_commission_close(&round->engine);
	json_decref(round->registers);
	json_decref(round->drive_keys);
	json_decref(round->bus_keys);
	json_decref(round->done);
	json_decref(round->description);
}
