/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What an hour of the audit trail costs at ten commands a second, each with its end: bytes of the files,
 * processor time of the thread that writes, and what the thread that posts pays for one command.
 *
 *   audit FOLDER [COMMANDS]    the folder is made, and has the files afterwards
 *
 * Instructions of the thread that posts: valgrind --tool=callgrind --toggle-collect=db_audit_post
 * --toggle-collect=db_audit_end.
 */
#include "drivebridge/audit.h"
#include "drivebridge/result.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define HOUR 36000
/* So that the thread writes each command by itself, as it would; and comes after where the machine is busy. */
#define PAUSE_NS 50000
#define LONG_PAUSE_NS (20 * DB_NS_PER_MS)
#define LONG_PAUSE_EVERY 50
#define CALIBRATION 1000

static double seconds(clockid_t clock)
{
	struct timespec now;

	clock_gettime(clock, &now);
	return (double)now.tv_sec + (double)now.tv_nsec / 1e9;
}

static void wait_until_written(struct db_audit *audit)
{
	struct db_audit_query query = { .from = UINT32_MAX };
	struct db_audit_page page;

	/* A page is read behind all records. */
	while (!db_audit_ask(audit, 1, &query))
		continue;
	while (!db_audit_take(audit, 1, &page))
		nanosleep(&(struct timespec){ .tv_nsec = PAUSE_NS }, NULL);
	free(page.records);
}

int main(int argc, char **argv)
{
	unsigned count = argc > 2 ? (unsigned)atoi(argv[2]) : HOUR;
	struct db_audit_setup setup = { .folder = argc > 1 ? argv[1] : NULL,
		                        .on = true,
		                        .mib = 64 };
	struct db_audit_entry entry = {
		.kind = DB_AUDIT_COMMAND,
		.result = DB_RESULT_PENDING,
		.time_us = UINT64_C(1800000000000000),
		.address = { [10] = 0xFF, 0xFF, 192, 168, 10, 5 },
		.port = 51234,
		.drive = "feeder",
		.command = DB_CMD_MOVE_ABSOLUTE,
		.args = { .target_position = 640000, .target_velocity = 3200.0f },
	};
	const struct timespec pauses[] = { { .tv_nsec = PAUSE_NS }, { .tv_nsec = LONG_PAUSE_NS } };
	struct db_audit_state state;
	struct db_audit *audit;
	double posting = 0.0;
	double others;
	double clocks;

	if (!setup.folder || db_audit_new(&setup, DB_NS_PER_S, &audit) != 0) {
		(void)fputs("usage: audit FOLDER [COMMANDS]\n", stderr);
		return 2;
	}
	clocks = seconds(CLOCK_THREAD_CPUTIME_ID);
	for (unsigned i = 0; i < CALIBRATION; i++)
		(void)seconds(CLOCK_THREAD_CPUTIME_ID);
	clocks = (seconds(CLOCK_THREAD_CPUTIME_ID) - clocks) / CALIBRATION;
	others = seconds(CLOCK_PROCESS_CPUTIME_ID) - seconds(CLOCK_THREAD_CPUTIME_ID);
	for (unsigned i = 0; i < count; i++) {
		double before = seconds(CLOCK_THREAD_CPUTIME_ID);
		uint32_t number;

		entry.time_us += 100000;
		entry.id = (uint16_t)i;
		number = db_audit_post(audit, &entry, DB_NS_PER_S);
		db_audit_end(audit, number, entry.drive, DB_RESULT_OK, 12345,
		             entry.time_us + 12345);
		posting += seconds(CLOCK_THREAD_CPUTIME_ID) - before - clocks;
		nanosleep(&pauses[i % LONG_PAUSE_EVERY == 0], NULL);
	}
	wait_until_written(audit);
	others = seconds(CLOCK_PROCESS_CPUTIME_ID) - seconds(CLOCK_THREAD_CPUTIME_ID) - others;
	db_audit_state(audit, &state);
	printf("%u commands with their ends: %.1f MB of files (%.0f bytes each), %llu records lost\n"
	       "the writing thread: %.2f s of processor (%.1f us each)\n"
	       "the thread that posts: %.2f us each\n",
	       count, (double)state.bytes / 1e6, (double)state.bytes / count,
	       (unsigned long long)state.lost, others, others / count * 1e6, posting / count * 1e6);
	db_audit_free(audit);
	return state.lost == 0 ? 0 : 1;
}
