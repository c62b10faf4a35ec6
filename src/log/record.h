/* SPDX-License-Identifier: Apache-2.0 */
/* One line of the log on its way to whoever writes it. Pure. Internal to src/log. */
#ifndef DRIVEBRIDGE_LOG_RECORD_H
#define DRIVEBRIDGE_LOG_RECORD_H

#include "drivebridge/log.h"

#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#define DB_LOG_TEXT_MAX 512
#define DB_LOG_NAME_MAX 64
#define DB_LOG_CLIENT_MAX 96 /* with whom it acts for */

/* Too long texts and names are cut. */
struct db_log_record {
	enum db_event event;
	uint64_t subject; /* the same for lines of one topic about the same bus, drive and client */
	unsigned unit;
	unsigned told;             /* where in the text the message begins, behind the names */
	char bus[DB_LOG_NAME_MAX]; /* "" = none, likewise the next two */
	char drive[DB_LOG_NAME_MAX];
	char client[DB_LOG_CLIENT_MAX];
	char text[DB_LOG_TEXT_MAX];
};

/* `about` and the bus may be null. */
__attribute__((format(printf, 5, 0))) void db_log_record_init(struct db_log_record *record,
                                                              const char *bus, enum db_event event,
                                                              const struct db_log_about *about,
                                                              const char *format,
                                                              va_list arguments);

/* How often it happened beside, in so many seconds, goes behind the text. */
void db_log_record_add_count(struct db_log_record *record, uint32_t count, uint32_t seconds);

/* The journal's fields, "NAME=value" each: how many. The texts are in `store`. */
#define DB_LOG_FIELDS_MAX 9
#define DB_LOG_FIELD_MAX (DB_LOG_TEXT_MAX + 32)
size_t db_log_record_fields(const struct db_log_record *record,
                            char store[DB_LOG_FIELDS_MAX][DB_LOG_FIELD_MAX]);

#endif
