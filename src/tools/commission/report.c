/* SPDX-License-Identifier: Apache-2.0 */
#include "commission/report.h"
#include "commission/judge.h"
#include "commission/section.h"
#include "words/value.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

size_t db_commission_report_count(const json_t *verdicts, const char *verdict)
{
	size_t count = 0;
	size_t i;
	const json_t *one;

	json_array_foreach(verdicts, i, one)
	{
		if (strcmp(db_words_text(one, "verdict"), verdict) == 0)
			count++;
	}
	return count;
}

static void print_verdict(FILE *out, const json_t *verdict,
                          const struct db_words_language *language)
{
	char room[DB_WORDS_TEXT_MAX];
	const char *word = db_words_find_text(language, db_words_text(verdict, "verdict"));
	unsigned columns = db_words_columns(word, strlen(word));
	const char *right = db_words_text(verdict, "right");
	bool key = db_words_text(verdict, "section")[0] != '\0';

	fprintf(out, "  %s%*s  %-20s", word, columns < 14 ? 14 - (int)columns : 0, "",
	        db_words_text(verdict, "setting"));
	if (db_words_text(verdict, "now")[0])
		fprintf(out, " = %s", db_words_text(verdict, "now"));
	fprintf(out, "\n                %s\n",
	        db_words_in(language, db_words_text(verdict, "how"), room));
	if (right[0])
		fprintf(out, "                %s%s\n",
		        key ? db_words_find_text(language, "right: ") : "",
		        db_words_in(language, right, room));
}

void db_commission_report_verdicts(FILE *out, const json_t *verdicts, const char *step,
                                   const struct db_words_language *language)
{
	static const char *const order[] = { DB_COMMISSION_CONTRADICTED, DB_COMMISSION_PROVEN,
		                             DB_COMMISSION_NOT_SEEN, DB_COMMISSION_NOT_FOR };
	size_t i;
	const json_t *verdict;

	for (size_t kind = 0; kind < sizeof(order) / sizeof(order[0]); kind++) {
		json_array_foreach(verdicts, i, verdict)
		{
			if (strcmp(db_words_text(verdict, "verdict"), order[kind]) == 0 &&
			    (!step || strcmp(db_words_text(verdict, "step"), step) == 0))
				print_verdict(out, verdict, language);
		}
	}
}

void db_commission_report_sections(FILE *out, const struct db_commission_report *report)
{
	static const char *const sections[] = { "bus", "drive" };
	const char *const names[] = { report->bus, report->drive };
	json_t *const keys[] = { report->bus_keys, report->drive_keys };

	if (report->problem[0])
		fprintf(out,
		        "the configuration could not be read (%s): what follows has only "
		        "what changes\n",
		        report->problem);
	for (size_t i = 0; i < 2; i++) {
		if (db_commission_section_changes(sections[i], report->verdicts))
			db_commission_section_write(out, sections[i], names[i], keys[i],
			                            report->verdicts);
		else
			fprintf(out, "# %s %s: nothing that was seen changes it\n", sections[i],
			        names[i]);
	}
}

void db_commission_report_write(FILE *out, const struct db_commission_report *report)
{
	char when[40] = "";
	time_t now = time(NULL);
	struct tm broken;
	size_t i;
	const json_t *name;

	if (localtime_r(&now, &broken))
		(void)strftime(when, sizeof(when), "%Y-%m-%d %H:%M:%S", &broken);
	fprintf(out, "commissioning of %s (%s on bus %s)\n%s\n", report->drive, report->family,
	        report->bus, when);
	if (report->identity[0])
		fprintf(out, "it says that it is %s\n", report->identity);
	fputs("steps that were done:", out);
	json_array_foreach(report->done, i, name)
	{
		fprintf(out, " %s", json_string_value(name));
	}
	fprintf(out, "\n\n%zu contradicted, %zu proven, %zu not seen\n\n",
	        db_commission_report_count(report->verdicts, DB_COMMISSION_CONTRADICTED),
	        db_commission_report_count(report->verdicts, DB_COMMISSION_PROVEN),
	        db_commission_report_count(report->verdicts, DB_COMMISSION_NOT_SEEN));
	db_commission_report_verdicts(out, report->verdicts, NULL, NULL);
	fputs("\nfor the configuration, then drivebridgectl reload:\n\n", out);
	db_commission_report_sections(out, report);
}

char *db_commission_report_copy(const struct db_commission_report *report,
                                void (*write)(FILE *out, const struct db_commission_report *report))
{
	char *text = NULL;
	size_t length = 0;
	FILE *out = open_memstream(&text, &length);

	if (!out)
		return NULL;
	write(out, report);
	if (fclose(out) == 0)
		return text;
	free(text);
	return NULL;
}
