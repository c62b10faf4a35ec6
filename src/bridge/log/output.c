/* SPDX-License-Identifier: Apache-2.0 */
#include "log/log_private.h"

#include "log/event.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

/* The place in the sources is of no use to readers of the log. */
#define SD_JOURNAL_SUPPRESS_LOCATION
#include <systemd/sd-journal.h>

bool db_log_is_journal(int fd, const char *journal_stream)
{
	uintmax_t device, inode;
	struct stat stat;
	char rest;

	/* Programs started by a service inherit the variable, however their output is redirected:
	 * the stream is the journal's only if the variable names this very stream. */
	return journal_stream && sscanf(journal_stream, "%ju:%ju%c", &device, &inode, &rest) == 2 &&
	       fstat(fd, &stat) == 0 && stat.st_dev == device && stat.st_ino == inode;
}

/* In one call, so that a line is never mixed with what other processes write there. */
static void write_line(int fd, const char *before, const struct db_log_record *record)
{
	char line[DB_LOG_TEXT_MAX + 8];
	int length = snprintf(line, sizeof(line), "%s%s\n", before, record->text);

	/* A failure cannot be reported anywhere. */
	(void)!write(fd, line, (size_t)length);
}

void db_log_write_text(void *context, const struct db_log_record *record)
{
	const int *fd = context;

	write_line(*fd, "", record);
}

void db_log_send_journal(char *const texts[], size_t count)
{
	struct iovec fields[DB_LOG_FIELDS_SENT_MAX];

	for (size_t i = 0; i < count && i < DB_LOG_FIELDS_SENT_MAX; i++)
		fields[i] = (struct iovec){ .iov_base = texts[i], .iov_len = strlen(texts[i]) };
	/* A failure cannot be reported anywhere. */
	(void)sd_journal_sendv(
		fields, (int)(count < DB_LOG_FIELDS_SENT_MAX ? count : DB_LOG_FIELDS_SENT_MAX));
}

void db_log_write_journal(void *context, const struct db_log_record *record)
{
	const int *fd = context;
	char store[DB_LOG_FIELDS_MAX][DB_LOG_FIELD_MAX];
	struct iovec fields[DB_LOG_FIELDS_MAX];
	size_t count = db_log_record_fields(record, store);
	char level[8];

	for (size_t i = 0; i < count; i++)
		fields[i] = (struct iovec){ .iov_base = store[i], .iov_len = strlen(store[i]) };
	if (sd_journal_sendv(fields, (int)count) >= 0)
		return;
	/* Standard error still leads there: written as a line with its level only. */
	snprintf(level, sizeof(level), "<%d>", (int)db_event_kind(record->event)->level);
	write_line(*fd, level, record);
}
