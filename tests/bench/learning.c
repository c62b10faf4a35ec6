/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What is learnt of drives that are deaf after their answers, or answer late, with nothing configured for it; and what that
 * does for a line of 32. In made-up time, byte by byte: the same on every machine. Prints the tables of
 * docs/cost.md.
 */
#include "fakes/rs485.h"

#define MS DB_NS_PER_MS
#define S DB_NS_PER_S

static const unsigned one[] = { 1, 0 };
static const unsigned thirty_two[] = { 1,  2,  3,  4,  5,  6,  7,  8,  9,  10, 11,
	                               12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22,
	                               23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 0 };

/* A drive alone on its line is moved and stopped for ten seconds. */
static struct db_snapshot after_work(db_time deaf, db_time late)
{
	struct rs485 *line = rs485_new(one);
	struct db_snapshot snapshot;

	line->nodes[0].deaf = deaf;
	line->nodes[0].latency = late;
	rs485_begin(line);
	fake_pass(line->bus, 3 * S);
	must(rs485_enable(line, 0) == DB_RESULT_OK);
	for (unsigned i = 0; i < 70; i++) {
		must(rs485_turn(line, 0, 400.0f + (float)i) == DB_RESULT_OK);
		fake_pass(line->bus, (7 + i) * MS);
		must(rs485_command(line, 0, (struct db_request){ .command = DB_CMD_STOP }) ==
		     DB_RESULT_OK);
		fake_pass(line->bus, (80 - i) * MS);
	}
	must(fake_is_online(line->bus, 0));
	snapshot = fake_snapshot(line->bus, 0);
	rs485_free(line);
	return snapshot;
}

static void print_gaps(void)
{
	printf("| deaf after its answers | gap that is left | requests lost until then |\n"
	       "|---|---|---|\n");
	for (db_time deaf = 0; deaf <= 8 * MS; deaf += MS) {
		struct db_snapshot snapshot = after_work(deaf, 0);
		unsigned gap = snapshot.learnt.gap_us ? snapshot.learnt.gap_us : 1000;

		printf("| %d ms | %.2f ms | %u of %u |\n", (int)(deaf / MS), gap / 1e3,
		       (unsigned)snapshot.stats.timeouts, (unsigned)snapshot.stats.requests);
	}
}

static void print_patience(void)
{
	printf("\n| late by | patience | requests lost until then |\n|---|---|---|\n");
	for (db_time late = 0; late <= 60 * MS; late += 10 * MS) {
		struct db_snapshot snapshot = after_work(0, late);
		unsigned patience = snapshot.learnt.latency_ms ? snapshot.learnt.latency_ms : 30;

		printf("| %d ms | %u ms | %u of %u |\n", (int)(late / MS), patience,
		       (unsigned)snapshot.stats.timeouts, (unsigned)snapshot.stats.requests);
	}
}

static struct rs485 *begin_full_line(bool adapt, db_time deaf)
{
	struct rs485 *line = rs485_new(thirty_two);

	line->bus->config.cycle_ms = 20;
	line->bus->config.adapt = adapt;
	line->config.latency = 0;
	line->nodes[6].deaf = deaf;
	rs485_begin(line);
	return line;
}

/* Of all drives together. */
static uint32_t count_samples(const struct rs485 *line)
{
	uint32_t samples = 0;

	for (size_t i = 0; i < line->bus->drive_count; i++)
		samples += rs485_samples(line, i);
	return samples;
}

static double round_ms(bool adapt)
{
	struct rs485 *line = begin_full_line(adapt, 0);
	uint32_t before;
	uint32_t after;

	fake_pass(line->bus, 30 * S);
	before = count_samples(line);
	fake_pass(line->bus, 30 * S);
	after = count_samples(line);
	rs485_free(line);
	return 32 * 30e3 / (after - before);
}

/* From its posting until the drive has heard it, in ms. */
static double first_stop_ms(db_time deaf, db_time moment)
{
	struct rs485 *line = begin_full_line(true, deaf);
	db_time posted;
	db_time waited;

	while (!fake_is_online(line->bus, 6))
		fake_pass(line->bus, MS);
	fake_pass(line->bus, moment);
	posted = line->bus->now;
	fake_post(line->bus, 6, DB_CMD_STOP);
	while (rs485_count_heard(&line->nodes[6], "7 stp") == 0)
		fake_pass(line->bus, MS / 10);
	waited = line->bus->now - posted;
	rs485_free(line);
	return (double)waited / 1e6;
}

static void print_full_line(void)
{
	printf("\n| 32 drives | |\n|---|---|\n");
	printf("| a round, `adapt = off` | %.1f ms |\n", round_ms(false));
	printf("| a round, as learnt after 30 s | %.1f ms |\n", round_ms(true));
	for (db_time deaf = 0; deaf <= 8 * MS; deaf += 2 * MS) {
		double longest = 0;

		for (db_time moment = 0; moment < 130 * MS; moment += 7 * MS) {
			double waited = first_stop_ms(deaf, moment);

			longest = waited > longest ? waited : longest;
		}
		printf("| the first stop of a drive that is deaf for %d ms is received within | %.1f ms |\n",
		       (int)(deaf / MS), longest);
	}
}

int main(void)
{
	print_gaps();
	print_patience();
	print_full_line();
	return 0;
}
