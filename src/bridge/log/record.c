/* SPDX-License-Identifier: Apache-2.0 */
#include "log/log_private.h"

#include "log/event.h"

#include "drivebridge/hash.h"

#include <stdio.h>
#include <string.h>

static void add_text(char text[DB_LOG_TEXT_MAX], const char *what, const char *name)
{
	size_t used = strlen(text);

	if (name[0] != '\0')
		snprintf(text + used, DB_LOG_TEXT_MAX - used, "%s %s: ", what, name);
}

/* With its end, so that where one text ends and the next begins makes a difference. If two subjects
 * have the same hash, one is only counted together with the other. */
static uint64_t add_to_hash(uint64_t hash, const char *text)
{
	return db_hash_add(hash, text, strlen(text) + 1);
}

void db_log_record_init(struct db_log_record *record, const char *bus, enum db_event event,
                        const struct db_log_about *about, const char *format, va_list arguments)
{
	static const struct db_log_about nobody = { 0 };
	size_t used;

	if (!about)
		about = &nobody;
	record->event = event;
	record->unit = about->unit;
	snprintf(record->bus, sizeof(record->bus), "%s", bus ? bus : "");
	snprintf(record->drive, sizeof(record->drive), "%s", about->drive ? about->drive : "");
	snprintf(record->client, sizeof(record->client), "%s", about->client ? about->client : "");
	record->text[0] = '\0';
	add_text(record->text, "bus", record->bus);
	add_text(record->text, "drive", record->drive);
	add_text(record->text, "client", record->client);
	used = strlen(record->text);
	record->told = (unsigned)used;
	vsnprintf(record->text + used, sizeof(record->text) - used, format, arguments);
	record->subject = DB_HASH_BEGIN ^ (uint64_t)db_event_kind(event)->topic;
	record->subject = add_to_hash(record->subject, record->bus);
	record->subject = add_to_hash(record->subject, record->drive);
	record->subject = add_to_hash(record->subject, record->client);
}

void db_log_record_add_count(struct db_log_record *record, uint32_t count, uint32_t seconds)
{
	char tail[80];
	size_t length = (size_t)snprintf(tail, sizeof(tail),
	                                 "; happened %u times more in the last %u s",
	                                 (unsigned)count, (unsigned)seconds);
	size_t used = strlen(record->text);

	/* The count is more useful than the end of the text. */
	if (used + length >= sizeof(record->text))
		used = sizeof(record->text) - length - 1;
	memcpy(record->text + used, tail, length + 1);
}

size_t db_log_record_fields(const struct db_log_record *record,
                            char store[DB_LOG_FIELDS_MAX][DB_LOG_FIELD_MAX])
{
	const struct db_event_kind *kind = db_event_kind(record->event);
	size_t n = 0;

	snprintf(store[n++], DB_LOG_FIELD_MAX, "MESSAGE=%s", record->text);
	snprintf(store[n++], DB_LOG_FIELD_MAX, "PRIORITY=%d", (int)kind->level);
	snprintf(store[n++], DB_LOG_FIELD_MAX, "MESSAGE_ID=%s", kind->message_id);
	snprintf(store[n++], DB_LOG_FIELD_MAX, "SYSLOG_IDENTIFIER=drivebridged");
	snprintf(store[n++], DB_LOG_FIELD_MAX, "DRIVEBRIDGE_EVENT=%s", kind->name);
	if (record->bus[0] != '\0')
		snprintf(store[n++], DB_LOG_FIELD_MAX, "DRIVEBRIDGE_BUS=%s", record->bus);
	if (record->drive[0] != '\0')
		snprintf(store[n++], DB_LOG_FIELD_MAX, "DRIVEBRIDGE_DRIVE=%s", record->drive);
	if (record->unit != 0)
		snprintf(store[n++], DB_LOG_FIELD_MAX, "DRIVEBRIDGE_UNIT=%u", record->unit);
	if (record->client[0] != '\0')
		snprintf(store[n++], DB_LOG_FIELD_MAX, "DRIVEBRIDGE_CLIENT=%s", record->client);
	return n;
}
