/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/bus_log.h"

#include "codec/can.h"
#include "drivebridge/driver.h"
#include "drivebridge/scale.h"
#include "drivebridge/trouble.h"

#include <stddef.h>
#include <stdio.h>
#include <string.h>

void bus_log_timing(const struct db_log_source *log, const struct db_bus_config *bus,
                    const struct db_drive_config *drive, enum db_event event, db_time time,
                    db_time now)
{
	struct db_log_about about = { .drive = drive->name, .unit = drive->unit };
	unsigned ms = (unsigned)((time + DB_NS_PER_MS - 1) / DB_NS_PER_MS);

	if (event == DB_EVENT_DRIVE_LATE)
		db_log(log, now, event, &about,
		       "answers after %u ms, and drive-latency-ms is %u: its answers are given up too "
		       "soon; set drive-latency-ms = %u",
		       ms, bus->drive_latency_ms, ms + ms / 2);
	else
		db_log(log, now, event, &about,
		       "does not hear requests that follow an answer within a few milliseconds, and "
		       "hears later ones; turnaround-us is %u: raise it",
		       bus->turnaround_us);
}

const char *bus_log_port_advice(const struct db_bus_config *bus, int error)
{
	return db_trouble_port_advice(bus->driver->medium == DB_MEDIUM_SERIAL, error);
}

static const char *mood(const struct db_feedback *feedback)
{
	return feedback->status & DB_STATUS_ENABLED ? "enabled" : "disabled";
}

/* What the bridge has found, and done nothing about: also what went on while it was not there. */
static void log_found(const struct db_log_source *log, const struct db_drive_config *drive,
                      const struct db_log_about *about, const struct db_feedback *feedback,
                      db_time now)
{
	double counts = db_scale_counts(drive, feedback);
	double position = feedback->position / counts;
	double velocity = (double)feedback->velocity / counts;

	if (feedback->status & DB_STATUS_MOVING)
		db_log(log, now, DB_EVENT_DRIVE_ONLINE, about,
		       "answers at address %u: %s, moving at %.6g %s/s, position %.10g %s, error %s",
		       drive->address, mood(feedback), velocity, drive->unit_name, position,
		       drive->unit_name, db_error_name(feedback->error));
	else
		db_log(log, now, DB_EVENT_DRIVE_ONLINE, about,
		       "answers at address %u: %s, standing, position %.10g %s, error %s",
		       drive->address, mood(feedback), position, drive->unit_name,
		       db_error_name(feedback->error));
}

void bus_log_event(const struct db_log_source *log, const struct db_drive_config *drive,
                   enum db_event event, const struct db_feedback *feedback, db_time now)
{
	struct db_log_about about = { .drive = drive->name, .unit = drive->unit };

	switch (event) {
	case DB_EVENT_DRIVE_ONLINE:
		log_found(log, drive, &about, feedback, now);
		break;
	case DB_EVENT_DRIVE_LOST:
		db_log(log, now, event, &about,
		       "does not answer at address %u; check its power, wiring, address and baud or "
		       "bit rate",
		       drive->address);
		break;
	case DB_EVENT_DRIVE_DOUBLED:
		db_log(log, now, event, &about,
		       "two drives answer at address %u, each its own; disconnect one of them and give it "
		       "another address: until then nobody knows whose position is shown",
		       drive->address);
		break;
	case DB_EVENT_DRIVE_RUNS_ON:
		db_log(log, now, event, &about,
		       "was told to stop and does not slow down: %.6g %s/s after %u ms (status %08X); it "
		       "is told on%s: switch it off if it is a danger",
		       (double)feedback->velocity / db_scale_counts(drive, feedback),
		       drive->unit_name, drive->stop_reaction_ms, (unsigned)feedback->drive_status,
		       drive->on_stop_failure == DB_ON_STOP_FAILURE_DISABLE ? " and is disabled" :
		                                                              "");
		break;
	case DB_EVENT_DRIVE_FAULT:
		db_log(log, now, event, &about,
		       "reports the fault %s (status %08X, fault bits %04X); %s, then clear_fault",
		       db_error_name(feedback->error), (unsigned)feedback->drive_status,
		       (unsigned)feedback->fault_bits, db_trouble_fault_advice(feedback->error));
		break;
	case DB_EVENT_DRIVE_FAULT_GONE:
		db_log(log, now, event, &about, "has no fault any more");
		break;
	case DB_EVENT_DRIVE_WARNING:
		db_log(log, now, event, &about,
		       "warns (status %08X, fault bits %04X); see the drive's manual",
		       (unsigned)feedback->drive_status, (unsigned)feedback->fault_bits);
		break;
	case DB_EVENT_DRIVE_UNCONFIRMED:
		db_log(log, now, event, &about,
		       "is let go and did not confirm its on-exit; it may still move: look at it");
		break;
	case DB_EVENT_DRIVE_RESTARTED:
		db_log(log, now, event, &about,
		       "was restarted: its position and unsaved parameters are lost; check its power, "
		       "and home it");
		break;
	case DB_EVENT_DRIVE_MAY_HAVE_RESTARTED:
		db_log(log, now, event, &about,
		       "%s may have been restarted: where its position is counted from is not certain "
		       "(status %08X, position %.10g %s); check its power, and home it or set its position",
		       feedback->doubt == DB_DOUBT_SILENT ? "was silent and" :
		                                            "shows one sign of a restart and",
		       (unsigned)feedback->drive_status,
		       feedback->position / db_scale_counts(drive, feedback), drive->unit_name);
		break;
	default:
		break;
	}
}

void bus_log_missing_params(const struct db_log_source *log, const struct db_drive_config *drive,
                            const struct db_driver *driver, uint64_t params, db_time now)
{
	struct db_log_about about = { .drive = drive->name, .unit = drive->unit };
	char names[256] = "";

	for (size_t i = 0; i < driver->param_count; i++) {
		size_t length = strlen(names);

		if (params >> i & 1)
			snprintf(names + length, sizeof names - length, "%s%s", length ? ", " : "",
			         driver->params[i].name);
	}
	db_log(log, now, DB_EVENT_DRIVE_PARAMS_MISSING, &about,
	       "does not tell %s; its other parameters are shown, and read_parameters asks again",
	       names);
}

#define FRAME_TEXT_MAX (2 * sizeof((struct db_heard *)0)->bytes + sizeof "12345678#...")

/* "165#0000" for a CAN frame, else its bytes. */
static void write_frame(const struct db_heard *heard, enum db_medium medium, char *text)
{
	const uint8_t *bytes = heard->bytes;
	size_t length = heard->length;
	struct db_can_frame frame;

	if (medium == DB_MEDIUM_CAN && length == sizeof frame) {
		memcpy(&frame, heard->bytes, sizeof frame);
		text += sprintf(text, frame.id & DB_CAN_EXTENDED ? "%08X#" : "%03X#",
		                (unsigned)(frame.id & DB_CAN_ID_MASK));
		bytes = heard->bytes + offsetof(struct db_can_frame, data);
		length = frame.length < DB_CAN_DATA_MAX ? frame.length : DB_CAN_DATA_MAX;
	}
	for (size_t i = 0; i < length; i++)
		text += sprintf(text, "%02X", bytes[i]);
	if (medium != DB_MEDIUM_CAN && length == sizeof heard->bytes)
		(void)sprintf(text, "...");
	else
		*text = '\0';
}

void bus_log_raw(const struct db_log_source *log, const struct db_drive_config *drive,
                 enum db_medium medium, bool sent, const uint8_t *bytes, size_t length, db_time now)
{
	struct db_log_about about = { .drive = drive->name, .unit = drive->unit };
	struct db_heard frame = { .length = length };
	char text[FRAME_TEXT_MAX];

	if (frame.length > sizeof frame.bytes)
		frame.length = sizeof frame.bytes;
	if (length == 0) {
		db_log(log, now, DB_EVENT_RAW_FRAME, &about,
		       "does not answer that; whether it was carried out is not known");
		return;
	}
	memcpy(frame.bytes, bytes, frame.length);
	write_frame(&frame, medium, text);
	db_log(log, now, DB_EVENT_RAW_FRAME, &about,
	       sent ? "is sent a client's own frame, %s" : "answers that with %s", text);
}

void bus_log_heard(const struct db_log_source *log, const struct db_drive_config *drive,
                   enum db_medium medium, const struct db_heard *heard, db_time now)
{
	struct db_log_about about = { .drive = drive->name, .unit = drive->unit };
	char text[FRAME_TEXT_MAX];

	write_frame(heard, medium, text);
	db_log(log, now, DB_EVENT_DRIVE_HEARD, &about,
	       "is heard at address %u all the same: %u frames that are no answer to what was asked, "
	       "the last one %s; check protocol, address and what the drive's manual says of it",
	       drive->address, (unsigned)heard->count, text);
}
