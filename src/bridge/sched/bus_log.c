/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/bus_log.h"

#include "codec/can.h"
#include "drivebridge/driver.h"
#include "drivebridge/scale.h"
#include "drivebridge/trouble.h"

#include <stddef.h>
#include <stdio.h>
#include <string.h>

/* A computer that keeps the bus waiting for this part of the time keeps others waiting too: what
 * passes bytes on from an adapter, or a simulator. Then a late answer says little about its drive.
 */
#define BUSY_SHARE 50

void bus_log_timing(const struct db_log_source *log, const struct db_bus_config *bus,
                    const struct db_drive_config *drive, const struct bus_timing *timing,
                    db_time now)
{
	struct db_log_about about = { .drive = drive->name, .unit = drive->unit };
	bool late = timing->told.event == DB_EVENT_DRIVE_LATE;
	bool busy = timing->missed * BUSY_SHARE > (db_time)timing->seconds * DB_NS_PER_S;
	unsigned missed_ms = (unsigned)(timing->missed / DB_NS_PER_MS);
	unsigned ms = (unsigned)((timing->told.time + DB_NS_PER_MS - 1) / DB_NS_PER_MS);
	unsigned learnt_ms = (unsigned)((timing->told.learnt + DB_NS_PER_MS - 1) / DB_NS_PER_MS);
	unsigned learnt_us = (unsigned)((timing->told.learnt + DB_NS_PER_US - 1) / DB_NS_PER_US);

	if (late && timing->told.learnt > 0 && busy)
		db_log(log, now, timing->told.event, &about,
		       "answers up to %u ms after a request: the bus now waits %u ms for it; this "
		       "computer is busy, the bus waited %u ms for a processor in the last %u s: "
		       "find out what else runs, and set drive-latency-ms = %u to keep that after "
		       "a restart only if it stays so",
		       ms, learnt_ms, missed_ms, timing->seconds, learnt_ms);
	else if (late && timing->told.learnt > 0)
		db_log(log, now, timing->told.event, &about,
		       "answers up to %u ms after a request: the bus now waits %u ms for it; set "
		       "drive-latency-ms = %u to keep that after a restart",
		       ms, learnt_ms, learnt_ms);
	else if (late && busy)
		db_log(log, now, timing->told.event, &about,
		       "answers %u ms after a request, but the bus waits only drive-latency-ms = "
		       "%u for it; this computer is busy, the bus waited %u ms for a processor in "
		       "the last %u s: find out what else runs, and set drive-latency-ms = %u only "
		       "if it stays so",
		       ms, bus->drive_latency_ms, missed_ms, timing->seconds, ms + ms / 2);
	else if (late)
		db_log(log, now, timing->told.event, &about,
		       "answers %u ms after a request, but the bus waits only drive-latency-ms = "
		       "%u for it; set drive-latency-ms = %u",
		       ms, bus->drive_latency_ms, ms + ms / 2);
	else if (timing->told.others)
		db_log(log, now, timing->told.event, &about,
		       "requests to other drives sent %u us after its answers are lost: the bus "
		       "now waits %u us; set turnaround-us = %u to keep that after a restart",
		       bus->turnaround_us, learnt_us, learnt_us);
	else if (timing->told.learnt > 0)
		db_log(log, now, timing->told.event, &about,
		       "does not receive requests sent %u us after its answers: the bus now waits "
		       "%u us; set turnaround-us = %u to keep that after a restart",
		       bus->turnaround_us, learnt_us, learnt_us);
	else
		db_log(log, now, timing->told.event, &about,
		       "does not receive requests that follow its answer within a few "
		       "milliseconds, but receives later ones; raise turnaround-us, which is %u",
		       bus->turnaround_us);
}

void bus_log_slow(const struct db_log_source *log, const struct db_bus_config *bus,
                  const struct bus_slowness *slow, db_time now)
{
	db_time missed = slow->waited > slow->overslept ? slow->waited : slow->overslept;

	/* At least a quarter of a cycle of waiting for each cycle that overran: then the computer
	 * is the cause. */
	if (missed / DB_NS_PER_MS * 4 > (db_time)slow->overruns * bus->cycle_ms)
		db_log(log, now, DB_EVENT_BUS_SLOW, NULL,
		       "%u times in %u s the drives could not all be read within cycle-ms = %u: "
		       "this computer is busy, the bus waited %u ms for a processor; %s",
		       (unsigned)slow->overruns, slow->seconds, bus->cycle_ms,
		       (unsigned)(missed / DB_NS_PER_MS),
		       slow->has_priority ?
		               "find out what else has a real-time priority" :
		               "give it a real-time priority, or find out what else runs");
	else
		db_log(log, now, DB_EVENT_BUS_SLOW, NULL,
		       "%u times in %u s the drives could not all be read within cycle-ms = %u "
		       "(the last round over all took %u ms); raise cycle-ms or baud, or find "
		       "drives that answer slowly or not at all",
		       (unsigned)slow->overruns, slow->seconds, bus->cycle_ms,
		       (unsigned)(slow->cycle_us / 1000));
}

void bus_log_port_advice(const struct db_bus_config *bus, int error, const char *holder,
                         char text[DB_TROUBLE_ADVICE_MAX])
{
	db_trouble_port_advice(bus->driver->medium == DB_MEDIUM_SERIAL, error, bus->device, holder,
	                       text);
}

/* Logs what the drive does when it begins to answer: also what went on while the service was not
 * running. */
static void log_found(const struct db_log_source *log, const struct db_driver *driver,
                      const struct db_drive_config *drive, const struct db_log_about *about,
                      const struct db_feedback *feedback, const struct db_outage *outage,
                      db_time now)
{
	const char *power = feedback->status & DB_STATUS_ENABLED ? "enabled" : "disabled";
	char error[DB_ERROR_TEXT_MAX];
	char after[64] = "";

	double counts = db_scale_counts(drive, feedback);
	double position = feedback->position / counts;
	double velocity = (double)feedback->velocity / counts;

	/* Each outage has an end with its length and its cause. */
	if (outage)
		snprintf(after, sizeof(after), " again, after %.1f s (%s)",
		         (double)outage->time / (double)DB_NS_PER_S,
		         db_trouble_name(outage->cause));
	if (feedback->status & DB_STATUS_MOVING)
		db_log(log, now, DB_EVENT_DRIVE_ONLINE, about,
		       "answers at address %u%s: %s, moving at %.6g %s/s, position %.10g %s, error "
		       "%s",
		       drive->address, after, power, velocity, drive->unit_name, position,
		       drive->unit_name, db_error_text(driver, feedback->error, error));
	else
		db_log(log, now, DB_EVENT_DRIVE_ONLINE, about,
		       "answers at address %u%s: %s, standing, position %.10g %s, error %s",
		       drive->address, after, power, position, drive->unit_name,
		       db_error_text(driver, feedback->error, error));
}

static void log_runs_on(const struct db_log_source *log, const struct db_driver *driver,
                        const struct db_drive_config *drive, const struct db_log_about *about,
                        const struct db_feedback *feedback, db_time now)
{
	const char *then = drive->on_stop_failure == DB_ON_STOP_FAILURE_DISABLE ?
	                           ", and the drive is disabled" :
	                           "";

	/* The stop is for all axes of the controller, and this one is seen to stand. */
	if (driver->axes > 1 && !(feedback->status & DB_STATUS_MOVING)) {
		db_log(log, now, DB_EVENT_DRIVE_RUNS_ON, about,
		       "its controller did not answer a stop within %u ms; this axis stands, the "
		       "stop is repeated for the others",
		       drive->stop_reaction_ms);
		return;
	}
	db_log(log, now, DB_EVENT_DRIVE_RUNS_ON, about,
	       "was sent a stop and does not slow down: %.6g %s/s after %u ms (status %08X); the "
	       "stop is repeated%s; switch the drive off if it is a danger",
	       (double)feedback->velocity / db_scale_counts(drive, feedback), drive->unit_name,
	       drive->stop_reaction_ms, (unsigned)feedback->drive_status, then);
}

void bus_log_event(const struct db_log_source *log, const struct db_driver *driver,
                   const struct db_drive_config *drive, enum db_event event,
                   const struct db_feedback *feedback, const struct db_outage *outage, db_time now)
{
	struct db_log_about about = { .drive = drive->name, .unit = drive->unit };
	char error[DB_ERROR_TEXT_MAX];

	switch (event) {
	case DB_EVENT_DRIVE_ONLINE:
		log_found(log, driver, drive, &about, feedback, outage, now);
		break;
	case DB_EVENT_DRIVE_LOST:
		db_log(log, now, event, &about,
		       "does not answer at address %u; check its power, wiring, address and baud "
		       "or bit rate",
		       drive->address);
		break;
	case DB_EVENT_DRIVE_DOUBLED:
		db_log(log, now, event, &about,
		       "two drives answer at address %u; disconnect one of them and give it "
		       "another address: until then the position shown may be the other drive's",
		       drive->address);
		break;
	case DB_EVENT_DRIVE_RUNS_ON:
		log_runs_on(log, driver, drive, &about, feedback, now);
		break;
	case DB_EVENT_DRIVE_FAULT:
		db_log(log, now, event, &about,
		       "reports the fault %s (status %08X, fault bits %04X); %s, then clear_fault",
		       db_error_text(driver, feedback->error, error),
		       (unsigned)feedback->drive_status, (unsigned)feedback->fault_bits,
		       db_trouble_fault_advice(driver, feedback->error));
		break;
	case DB_EVENT_DRIVE_FAULT_GONE:
		db_log(log, now, event, &about, "reports no fault any more");
		break;
	case DB_EVENT_DRIVE_WARNING:
		db_log(log, now, event, &about,
		       "reports a warning (status %08X, fault bits %04X); see the drive's manual",
		       (unsigned)feedback->drive_status, (unsigned)feedback->fault_bits);
		break;
	case DB_EVENT_DRIVE_UNCONFIRMED:
		db_log(log, now, event, &about,
		       "is released and did not confirm its on-exit; it may still move: check it");
		break;
	case DB_EVENT_DRIVE_RESTARTED:
		db_log(log, now, event, &about,
		       "was restarted: its position and unsaved parameters are lost; check its "
		       "power, and home it");
		break;
	case DB_EVENT_DRIVE_MAY_HAVE_RESTARTED:
		db_log(log, now, event, &about,
		       "%s may have been restarted: where its position is counted from is not "
		       "certain (status %08X, position %.10g %s); check its power, and home it or "
		       "set its position",
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
                            const struct db_driver *driver, const uint64_t *params, db_time now)
{
	struct db_log_about about = { .drive = drive->name, .unit = drive->unit };
	char names[256] = "";

	for (size_t i = 0; i < driver->param_count; i++) {
		size_t length = strlen(names);

		if (db_params_have(params, i) && length < sizeof(names) - 1)
			snprintf(names + length, sizeof(names) - length, "%s%s", length ? ", " : "",
			         driver->params[i].name);
	}
	db_log(log, now, DB_EVENT_DRIVE_PARAMS_MISSING, &about,
	       "does not report %s; its other parameters are shown; read_parameters asks again",
	       names);
}

#define FRAME_TEXT_MAX (2 * sizeof((struct db_unusable *)0)->bytes + sizeof("12345678#..."))

/* "165#0000" for a CAN frame, else its bytes. */
static void write_frame(const struct db_unusable *unusable, enum db_medium medium, char *text)
{
	const uint8_t *bytes = unusable->bytes;
	size_t length = unusable->length;
	struct db_can_frame frame;

	if (medium == DB_MEDIUM_CAN && length == sizeof(frame)) {
		memcpy(&frame, unusable->bytes, sizeof(frame));
		text += sprintf(text, frame.id & DB_CAN_EXTENDED ? "%08X#" : "%03X#",
		                (unsigned)(frame.id & DB_CAN_ID_MASK));
		bytes = unusable->bytes + offsetof(struct db_can_frame, data);
		length = frame.length < DB_CAN_DATA_MAX ? frame.length : DB_CAN_DATA_MAX;
	}
	for (size_t i = 0; i < length; i++)
		text += sprintf(text, "%02X", bytes[i]);
	if (medium != DB_MEDIUM_CAN && length == sizeof(unusable->bytes))
		(void)sprintf(text, "...");
	else
		*text = '\0';
}

void bus_log_raw_frame(const struct db_log_source *log, const struct db_drive_config *drive,
                       enum db_medium medium, bool sent, const uint8_t *bytes, size_t length,
                       db_time now)
{
	struct db_log_about about = { .drive = drive->name, .unit = drive->unit };
	struct db_unusable frame = { .length = length };
	char text[FRAME_TEXT_MAX];

	if (frame.length > sizeof(frame.bytes))
		frame.length = sizeof(frame.bytes);
	if (length == 0) {
		db_log(log, now, DB_EVENT_RAW_FRAME, &about,
		       "does not answer the raw frame; whether it was carried out is not known");
		return;
	}
	memcpy(frame.bytes, bytes, frame.length);
	write_frame(&frame, medium, text);
	db_log(log, now, DB_EVENT_RAW_FRAME, &about,
	       sent ? "is sent a client's raw frame, %s" : "answers the raw frame with %s", text);
}

void bus_log_unusable(const struct db_log_source *log, const struct db_drive_config *drive,
                      enum db_medium medium, const struct db_unusable *unusable, db_time now)
{
	struct db_log_about about = { .drive = drive->name, .unit = drive->unit };
	char text[FRAME_TEXT_MAX];

	write_frame(unusable, medium, text);
	db_log(log, now, DB_EVENT_DRIVE_HEARD, &about,
	       "answers at address %u, but not as documented: %s is no answer to what was asked "
	       "(%u such frames); check protocol, address, model, and what the drive's manual says "
	       "about it",
	       drive->address, text, (unsigned)unusable->count);
}
