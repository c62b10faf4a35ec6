/* SPDX-License-Identifier: Apache-2.0 */
/* The results of a commissioning: verdicts for people, a report to keep, and the state to continue
 * from. */
#ifndef DRIVEBRIDGE_COMMISSION_REPORT_H
#define DRIVEBRIDGE_COMMISSION_REPORT_H

#include "commission/steps.h"
#include "words/language.h"

#include <stdio.h>

struct db_commission_report {
	const char *drive;
	const char *bus;
	const char *family;
	const char *identity;
	json_t *drive_keys;
	/* of both sections; a section that could not be read is not corrected */
	json_t *bus_keys;
	const char *problem; /* why the sections are missing; "" when they are there */
	const json_t *verdicts;
	const json_t *done; /* names of completed steps */
};

/* Lines for each verdict, the verdict first. Those of `step`, or all of them (NULL). `language`:
 * null for English. */
void db_commission_report_verdicts(FILE *out, const json_t *verdicts, const char *step,
                                   const struct db_words_language *language);

/* The corrected sections to paste; or a line that nothing is to be changed. */
void db_commission_report_sections(FILE *out, const struct db_commission_report *report);

/* The whole report, with the current time. */
void db_commission_report_write(FILE *out, const struct db_commission_report *report);

/* The output of one of the two as a text that the caller frees; NULL without memory. */
char *db_commission_report_copy(const struct db_commission_report *report,
                                void (*write)(FILE *out,
                                              const struct db_commission_report *report));

/* The number of settings and findings with this verdict. */
size_t db_commission_report_count(const json_t *verdicts, const char *verdict);

#endif
