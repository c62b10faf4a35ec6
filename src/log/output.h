/* SPDX-License-Identifier: Apache-2.0 */
/* Where lines end: the journal, or standard error. May block. Internal to src/log. */
#ifndef DRIVEBRIDGE_LOG_OUTPUT_H
#define DRIVEBRIDGE_LOG_OUTPUT_H

#include "log/record.h"

#include <stdbool.h>

/* Writes one line. */
typedef void db_log_write_fn(void *context, const struct db_log_record *record);

/* Whether the descriptor is the journal's, going by the value of JOURNAL_STREAM (null: not set). */
bool db_log_is_journal(int fd, const char *journal_stream);

/* The context is an int: the descriptor of the text, and of what the journal did not take. */
void db_log_write_text(void *context, const struct db_log_record *record);
void db_log_write_journal(void *context, const struct db_log_record *record);

#endif
