/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The bounds of docs/schedule.md against the real schedule, in made-up time: two and three drives that lose, double, delay
 * or garble every n-th of each kind of their answers, in all combinations, while commands keep coming, a drive obeys no
 * stop, one does not tell its parameters, one is off, or the line is scanned. The first drive answers everything: how long
 * its samples are apart, and how long its stops wait, must keep to the bounds.
 *
 * tests/run has a part of the combinations. All of them, in some minutes: sched_test_schedule_model 1 DRIVES, and with
 * learnt times: sched_test_schedule_model 1 DRIVES adapt
 */
#include "config/bounds.h"
#include "fakes/bus.h"
#include "sched/scan.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define DRIVES_MAX 3
#define LATENCY_MS 6
#define CYCLE_MS 4
#define TURNAROUND_US 1000
/* What one exchange costs that is not answered. */
#define WAIT (LATENCY_MS * MS + FAKE_WIRE_TIME + TURNAROUND_US * DB_NS_PER_US)

enum fault_kind { FAULT_NONE, FAULT_LOSES, FAULT_DOUBLES, FAULT_DELAYS, FAULT_GARBLES, FAULTS };

static const char *const fault_names[FAULTS] = { "none", "loses", "doubles", "delays", "garbles" };
static const unsigned every[] = { 2, 3, 5 };
static const char *const answer_names[] = { "polls", "commands", "stops", "all" };

#define EVERY (sizeof every / sizeof every[0])
#define ANSWERS (sizeof answer_names / sizeof answer_names[0])
#define SORTS (1 + (FAULTS - 1) * EVERY * ANSWERS) /* of a drive */

enum pressure { CALM, COMMANDS, NO_STOP, NO_PARAMETERS, ONE_OFF, SCANNED, PRESSURES };

static const char *const pressure_names[PRESSURES] = { "calm",          "commands", "no stop",
	                                               "no parameters", "one off",  "scanned" };

struct sort {
	enum fault_kind fault;
	unsigned every;
	size_t answers;
};

struct measure {
	db_time longest;
	db_time bound;
};

struct model {
	struct fake_bus *bus;
	struct db_driver driver;
	struct scan *scan;
	unsigned drives;
	enum pressure pressure;
	unsigned moving; /* bits */
	struct sort sorts[DRIVES_MAX];
	unsigned asked[DRIVES_MAX];
	struct fake_frame again; /* a doubled answer */
	db_time again_at;
	bool waits[DRIVES_MAX]; /* a command for it */

	db_time taken;       /* of the first drive's latest sample */
	struct measure gap;  /* between samples of the first drive */
	struct measure stop; /* from posting one for it to its first byte */
	db_time stop_posted; /* 0: none waits */
	bool measures;
	bool adapts; /* gaps and patience are learnt, within what is learnt at most */
};

static struct sort sort_of(size_t number)
{
	if (number == 0)
		return (struct sort){ 0 };
	number--;
	return (struct sort){
		.fault = (enum fault_kind)(1 + number / (EVERY * ANSWERS)),
		.every = every[number / ANSWERS % EVERY],
		.answers = number % ANSWERS,
	};
}

static bool is_faulty(struct model *model, unsigned drive, enum fake_kind kind)
{
	const struct sort *sort = &model->sorts[drive];
	bool meant = sort->answers == 3 || (sort->answers == 0 && kind == FAKE_POLL) ||
	             (sort->answers == 1 && kind == FAKE_COMMAND) ||
	             (sort->answers == 2 && kind == FAKE_STOP);

	return sort->fault != FAULT_NONE && meant && ++model->asked[drive] % sort->every == 0;
}

static db_time obey(void *context, struct fake_frame *frame)
{
	struct model *model = context;
	unsigned drive = frame->address - 1U;

	if (drive >= model->drives)
		return 0;
	if (drive == 0 && (frame->kind == FAKE_STOP || frame->kind == FAKE_DISABLE) &&
	    model->stop_posted != 0) {
		db_time waited = model->bus->now - model->stop_posted;

		if (model->measures && waited > model->stop.longest)
			model->stop.longest = waited;
		model->stop_posted = 0;
	}
	frame->speed = model->moving >> drive & 1 ? 10.0f : 0.0f;
	if (drive == 1 && model->pressure == NO_PARAMETERS && frame->kind == FAKE_IDENTIFY)
		return 0;
	if (!is_faulty(model, drive, (enum fake_kind)frame->kind))
		return FAKE_ANSWER_TIME;
	switch (model->sorts[drive].fault) {
	case FAULT_LOSES:
		return 0;
	case FAULT_DOUBLES:
		model->again = *frame;
		model->again_at = model->bus->now + FAKE_ANSWER_TIME + 200 * DB_NS_PER_US;
		return FAKE_ANSWER_TIME;
	case FAULT_DELAYS:
		return (LATENCY_MS + 2) * MS;
	default:
		frame->address = 0;
		return FAKE_ANSWER_TIME;
	}
}

static db_time next_double(void *context)
{
	const struct model *model = context;

	return model->again_at != 0 ? model->again_at : DB_TIME_NEVER;
}

static void happen(void *context)
{
	struct model *model = context;

	if (model->again_at == 0 || model->bus->now < model->again_at)
		return;
	model->again_at = 0;
	fake_receive(model->bus, &model->again, sizeof model->again);
}

static void watch(void *context)
{
	struct model *model = context;
	db_time taken = fake_feedback(model->bus, 0).taken;

	if (taken == model->taken)
		return;
	if (model->measures && taken - model->taken > model->gap.longest)
		model->gap.longest = taken - model->taken;
	model->taken = taken;
}

static bool inquire(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                    struct db_exchange *exchange)
{
	(void)bus;
	if (inquiry->kind != DB_INQUIRY_THERE)
		return false;
	fake_write_inquiry(inquiry, exchange);
	return true;
}

static enum db_recognised recognise(const struct db_bus_config *bus,
                                    const struct db_inquiry *inquiry, const uint8_t *bytes,
                                    size_t length, struct db_inquired *said)
{
	(void)bus;
	(void)inquiry;
	(void)bytes;
	(void)length;
	(void)said;
	return DB_RECOGNISED_NOTHING;
}

/* The drives, and one more where one is off. */
static void open_model(struct model *model)
{
	struct db_bus_config *config;

	model->driver = fake_family;
	model->driver.inquire = inquire;
	model->driver.recognise = recognise;
	model->bus = fake_bus_new(&model->driver, model->drives + (model->pressure == ONE_OFF));
	config = &model->bus->config;
	config->cycle_ms = CYCLE_MS;
	config->drive_latency_ms = LATENCY_MS;
	config->turnaround_us = TURNAROUND_US;
	config->adapt = model->adapts;
	model->bus->context = model;
	model->bus->obey = obey;
	model->bus->next = next_double;
	model->bus->happen = happen;
	model->bus->turned = watch;
	fake_bus_open(model->bus, model->bus->drive_count, NULL);
	fake_port(model->bus, 0);
	fake_pass(model->bus, 150 * MS);
}

static void begin_pressure(struct model *model)
{
	const struct db_scan_plan plan = { .first = 20, .last = 30 };

	if (model->pressure == NO_STOP) {
		model->moving |= 2;
		fake_pass(model->bus, 30 * MS);
		fake_post(model->bus, 1, DB_CMD_STOP);
	} else if (model->pressure == SCANNED) {
		model->scan = scan_new(&model->bus->config, &plan, 1);
		assert_non_null(model->scan);
		scan_begin(model->bus->engine, model->scan, model->bus->now);
	}
}

/* For so long; where commands keep coming each drive but the first has always one that waits. */
static void live(struct model *model, db_time span)
{
	struct db_request completion;

	for (db_time end = model->bus->now + span; model->bus->now < end;) {
		while (fake_collect(model->bus->queue, &completion))
			model->waits[(completion.ticket - 1) / DB_CMD_LIMIT] = false;
		for (unsigned i = 1; model->pressure == COMMANDS && i < model->drives; i++) {
			if (!model->waits[i])
				fake_post(model->bus, i, DB_CMD_ENABLE);
			model->waits[i] = true;
		}
		fake_pass(model->bus, MS);
	}
}

/* What the page of the law allows to the first drive. */
static void find_bounds(struct model *model)
{
	const struct db_bus_config *config = &model->bus->config;
	struct db_load_of_bus load = { .nodes = model->drives,
		                       .drives = model->drives,
		                       .busy = true };
	struct db_bounds bounds;
	db_time waits = 0;

	for (unsigned i = 1; i < model->drives; i++) {
		const struct sort *sort = &model->sorts[i];

		/* One for its status, one for its commands or stops. */
		if (sort->fault != FAULT_NONE && sort->fault != FAULT_DOUBLES)
			waits += model->pressure == COMMANDS || model->pressure == NO_STOP ? 2 : 1;
	}
	/* A class that has a small part waits until those with larger ones have paid for their waits. */
	waits += waits > 0 && model->pressure == COMMANDS && !(model->moving & 1);
	waits += model->pressure == NO_PARAMETERS || model->pressure == ONE_OFF ||
	         model->pressure == SCANNED;
	/* A drive that is commanded, or must stand, is read as if it moved. */
	for (unsigned i = 0; i < model->drives; i++)
		load.moving += (model->moving >> i & 1) || (model->pressure == COMMANDS && i > 0);
	db_bounds_of(config, &load, &bounds);
	model->gap.bound = (model->moving & 1 ? bounds.moving : bounds.standing) + waits * WAIT;
	/* Classes share what stops leave: a drive that obeys none takes up to a third of the wire. */
	if (model->pressure == NO_STOP)
		model->gap.bound += model->gap.bound / 2;
	model->stop.bound = bounds.stop + (model->adapts ? bounds.hearing : 0) +
	                    (waits > 0 ? WAIT : 0);
}

/* Stops of the first drive, at times that fit no cycle. False: one was not sent at all. */
static bool stop_again_and_again(struct model *model)
{
	bool sent = true;

	model->stop.longest = 0;
	for (unsigned n = 0; n < 12; n++) {
		live(model, 17 * MS + n * MS / 7);
		sent &= model->stop_posted == 0;
		model->stop_posted = model->bus->now;
		fake_post(model->bus, 0, DB_CMD_STOP);
	}
	live(model, 20 * MS);
	return sent && model->stop_posted == 0;
}

/* One combination. Returns what was wrong with it, or null. */
static const char *run(struct model *model)
{
	const char *wrong = NULL;

	open_model(model);
	begin_pressure(model);
	find_bounds(model);
	model->measures = true;
	live(model, 300 * MS);
	if (model->gap.longest > model->gap.bound)
		wrong = "samples";
	if (!(model->moving & 1)) {
		db_time gap = model->gap.longest;

		if (!stop_again_and_again(model) || model->stop.longest > model->stop.bound)
			wrong = "stops";
		model->gap.longest = gap;
	}
	if (model->scan) {
		scan_end(model->bus->engine, DB_SCAN_CANCELLED);
		scan_free(model->scan);
	}
	fake_bus_free(model->bus);
	return wrong;
}

static void tell(const struct model *model, const char *wrong)
{
	fprintf(stderr, "%s: %s, moving %u, samples %.2f ms apart, stops wait %.2f ms;", wrong,
	        pressure_names[model->pressure], model->moving, (double)model->gap.longest / 1e6,
	        (double)model->stop.longest / 1e6);
	for (unsigned i = 1; i < model->drives; i++)
		fprintf(stderr, " drive %u %s every %u of %s;", i,
		        fault_names[model->sorts[i].fault], model->sorts[i].every,
		        answer_names[model->sorts[i].answers]);
	fprintf(stderr, "\n");
}

/* What came nearest to its bound. */
struct worst {
	struct measure moving[PRESSURES];
	struct measure standing[PRESSURES];
	struct measure stop[PRESSURES];
};

static void keep_worst(struct measure *worst, const struct measure *one)
{
	if (one->bound > 0 &&
	    (worst->bound == 0 || one->longest * worst->bound > worst->longest * one->bound))
		*worst = *one;
}

static void print_worst(const char *what, const struct measure *worst)
{
	printf("  %-28s", what);
	for (size_t i = 0; i < PRESSURES; i++)
		printf(" %s %.1f of %.1f ms%s", pressure_names[i], (double)worst[i].longest / 1e6,
		       (double)worst[i].bound / 1e6, i + 1 < PRESSURES ? "," : "\n");
}

/* Every `step`-th of all combinations. */
static unsigned run_all(unsigned drives, size_t step, bool adapts)
{
	struct worst worst = { 0 };
	size_t faults = 1;
	size_t all;
	size_t count = 0;
	unsigned wrongs = 0;

	for (unsigned i = 1; i < drives; i++)
		faults *= SORTS;
	all = faults * PRESSURES * (1U << drives);
	for (size_t number = 0; number < all; number += step, count++) {
		struct model model = { .drives = drives, .adapts = adapts };
		size_t rest = number / PRESSURES / (1U << drives);
		const char *wrong;

		model.pressure = (enum pressure)(number % PRESSURES);
		model.moving = (unsigned)(number / PRESSURES % (1U << drives));
		for (unsigned i = 1; i < drives; i++, rest /= SORTS)
			model.sorts[i] = sort_of(rest % SORTS);
		wrong = run(&model);
		keep_worst(model.moving & 1 ? &worst.moving[model.pressure] :
		                              &worst.standing[model.pressure],
		           &model.gap);
		if (!(model.moving & 1))
			keep_worst(&worst.stop[model.pressure], &model.stop);
		if (wrong && wrongs++ < 20)
			tell(&model, wrong);
	}
	printf("%u drives: %zu of %zu combinations, %u wrong; longest, of its bound:\n", drives,
	       count, all, wrongs);
	print_worst("samples of one that moves:", worst.moving);
	print_worst("samples of one that stands:", worst.standing);
	print_worst("a stop's first byte:", worst.stop);
	return wrongs;
}

/* Primes, so that all sorts of faults come together with all pressures. */
static void two_drives(void **state)
{
	(void)state;
	assert_int_equal(run_all(2, 1, false), 0);
}

static void two_drives_with_learnt_times(void **state)
{
	(void)state;
	assert_int_equal(run_all(2, 5, true), 0);
}

static void three_drives(void **state)
{
	(void)state;
	assert_int_equal(run_all(3, 101, false), 0);
}

int main(int argc, char **argv)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(two_drives),
		cmocka_unit_test(two_drives_with_learnt_times),
		cmocka_unit_test(three_drives),
	};

	if (argc >= 3)
		return run_all((unsigned)atoi(argv[2]), (size_t)atoi(argv[1]), argc == 4) > 0;
	return cmocka_run_group_tests_name("schedule model", tests, NULL, NULL);
}
