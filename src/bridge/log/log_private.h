/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The files of the log for each other.
 */
#ifndef DRIVEBRIDGE_LOG_LOG_PRIVATE_H
#define DRIVEBRIDGE_LOG_LOG_PRIVATE_H

#include "drivebridge/log.h"

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* --- record.c --------------------------------------------------------------------------------- */

/* One line of the log before it is written. Pure. */

#define DB_LOG_TEXT_MAX 512
#define DB_LOG_NAME_MAX 64
#define DB_LOG_CLIENT_MAX 160 /* including its certificate, or for whom it acts */

/* Texts and names that are too long are truncated. */
struct db_log_record {
	enum db_event event;
	uint64_t subject; /* the same for lines of one topic about the same bus, drive and client */
	unsigned unit;
	/* position in the text where the message begins, after the names */
	unsigned told;
	char bus[DB_LOG_NAME_MAX]; /* "" = none, also in the next two */
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

/* Appends how often it happened in addition, and in how many seconds, to the text. */
void db_log_record_add_count(struct db_log_record *record, uint32_t count, uint32_t seconds);

/* The journal's fields, "NAME=value" each; returns their number. The texts are in `store`. */
#define DB_LOG_FIELDS_MAX 9
#define DB_LOG_FIELD_MAX (DB_LOG_TEXT_MAX + 32)
size_t db_log_record_fields(const struct db_log_record *record,
                            char store[DB_LOG_FIELDS_MAX][DB_LOG_FIELD_MAX]);

/* --- output.c --------------------------------------------------------------------------------- */

/* Outputs of lines: the journal, or standard error. May block. */

/* Writes one line. */
typedef void db_log_write_fn(void *context, const struct db_log_record *record);

/* True if the descriptor is the journal's, according to the value of JOURNAL_STREAM (null: not
 * set). */
bool db_log_is_journal(int fd, const char *journal_stream);

/* The context is an int: the descriptor for the text, and for lines that the journal did not
 * accept. */
void db_log_write_text(void *context, const struct db_log_record *record);
void db_log_write_journal(void *context, const struct db_log_record *record);

/* One entry of the journal, of "NAME=value" each. */
#define DB_LOG_FIELDS_SENT_MAX 16
void db_log_send_journal(char *const texts[], size_t count);

/* --- recent.c --------------------------------------------------------------------------------- */

/*
 * The latest lines of the log, for later queries: packed one after the other, because most are
 * short. Pure: no clock, no allocation.
 */

/* About two hundred bytes for each line. */
#define DB_RECENT_BYTES 49152

struct db_recent {
	uint64_t last;  /* number of the newest line; 0: none yet */
	uint32_t count; /* number of lines kept */
	uint32_t begin; /* position of the oldest one */
	uint32_t used;
	unsigned char bytes[DB_RECENT_BYTES]; /* a ring */
	/* Positions of the lines by number, modulo. */
	uint32_t places[DB_LOG_RECENT];
};

void db_recent_add(struct db_recent *recent, const struct db_log_record *record, uint64_t time_us);

/* The line of this number, or the oldest one after it. False: there is none. */
bool db_recent_find(const struct db_recent *recent, uint64_t from, struct db_log_line *line);

/* The latest of these events (DB_EVENT_BIT() each) with these names, "" for none, not older than
 * `since_us`. */
bool db_recent_latest(const struct db_recent *recent, uint64_t events, const char *bus,
                      const char *drive, uint64_t since_us, struct db_log_line *line);

/* --- log.c ------------------------------------------------------------------------------------ */

/* A log that writes elsewhere, for tests. */

/* Maximum number of lines waiting to be written. */
#define DB_LOG_QUEUE 64

/* Only the log's thread calls `write`. */
int db_log_new_to(db_log_write_fn *write, void *context, struct db_log **log);

#endif
