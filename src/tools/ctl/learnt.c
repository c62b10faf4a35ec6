/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/say.h"
#include "ctl/session.h"
#include "words/value.h"

#include <stdio.h>
#include <string.h>

#define GAP "learnt_gap_us"
#define LATENCY "learnt_latency_ms"

void db_ctl_add_learnt_names(json_t *names, const json_t *registers)
{
	if (db_words_look_up(registers, GAP) && db_words_look_up(registers, LATENCY)) {
		(void)json_array_append_new(names, json_string(GAP));
		(void)json_array_append_new(names, json_string(LATENCY));
	}
}

struct summary {
	long long gap_us; /* the longest one above the configured value; 0: none */
	long long latency_ms;
};

static void take_drive(const json_t *bus, const struct db_ctl_learnt *one, struct summary *summary)
{
	long long turnaround = json_integer_value(json_object_get(bus, "turnaround_us"));
	long long latency = json_integer_value(json_object_get(bus, "drive_latency_ms"));
	long long gap = db_words_number(one->values, GAP);
	long long patience = db_words_number(one->values, LATENCY);
	const char *drive = db_words_text(one->drive, "name");

	if (gap > turnaround) {
		db_ctl_say_line(stdout,
		                "%s: learnt: is left alone for %lld us after its answers, "
		                "turnaround-us is %lld",
		                drive, gap, turnaround);
		summary->gap_us = gap > summary->gap_us ? gap : summary->gap_us;
	}
	if (patience > latency) {
		db_ctl_say_line(stdout,
		                "%s: learnt: is given %lld ms to answer, drive-latency-ms is %lld",
		                drive, patience, latency);
		summary->latency_ms = patience > summary->latency_ms ? patience :
		                                                       summary->latency_ms;
	}
}

void db_ctl_print_learnt(const json_t *bus, const struct db_ctl_learnt *drives, size_t count)
{
	const char *name = db_words_text(bus, "name");
	struct summary summary = { 0 };

	/* A service from before an upgrade does not report the configured value. */
	if (!json_object_get(bus, "turnaround_us"))
		return;
	for (size_t i = 0; i < count; i++) {
		if (strcmp(db_words_text(drives[i].drive, "bus"), name) == 0)
			take_drive(bus, &drives[i], &summary);
	}
	if (summary.gap_us > 0 || summary.latency_ms > 0) {
		fputs("  ", stdout);
		printf(db_ctl_say("to keep that over a restart, in the section of bus %s:"), name);
	}
	if (summary.gap_us > 0)
		printf(" turnaround-us = %lld", summary.gap_us);
	if (summary.latency_ms > 0)
		printf("%s drive-latency-ms = %lld", summary.gap_us > 0 ? "," : "",
		       summary.latency_ms);
	if (summary.gap_us > 0 || summary.latency_ms > 0)
		putchar('\n');
}
