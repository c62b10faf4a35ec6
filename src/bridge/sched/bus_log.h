/* SPDX-License-Identifier: Apache-2.0 */
/* Log messages about drives: what has happened and what to check. Internal to src/bridge/sched. */
#ifndef DRIVEBRIDGE_SCHED_BUS_LOG_H
#define DRIVEBRIDGE_SCHED_BUS_LOG_H

#include "drivebridge/axis.h"
#include "drivebridge/config.h"
#include "drivebridge/log.h"
#include "drivebridge/trouble.h"
#include "sched/engine.h"

void bus_log_event(const struct db_log_source *log, const struct db_driver *driver,
                   const struct db_drive_config *drive, enum db_event event,
                   const struct db_feedback *feedback, const struct db_outage *outage, db_time now);

/* Logs what was received from a drive that does not answer, byte by byte. */
void bus_log_unusable(const struct db_log_source *log, const struct db_drive_config *drive,
                      enum db_medium medium, const struct db_unusable *unusable, db_time now);

/* Figures of a period in which many cycles overran. */
struct bus_slowness {
	uint32_t overruns;
	unsigned seconds;
	uint32_t cycle_us; /* duration of the last round over all drives */
	/* Time spent waiting for a processor, as the kernel counts it (0 where it does not), and as
	 * the thread measured it by waking up late: a delay may be counted by only one of them. */
	db_time waited;
	db_time overslept;
	bool has_priority; /* a real-time priority */
};
void bus_log_slow(const struct db_log_source *log, const struct db_bus_config *bus,
                  const struct bus_slowness *slow, db_time now);

/* Advice on what to check, for errors that make a port fail or keep it from being opened; "" when
 * there is none. */
void bus_log_port_advice(const struct db_bus_config *bus, int error, const char *holder,
                         char text[DB_TROUBLE_ADVICE_MAX]);

struct bus_timing {
	struct db_engine_timing told;
	db_time missed; /* time that the bus waited for a processor in the last `seconds` */
	unsigned seconds;
};
void bus_log_timing(const struct db_log_source *log, const struct db_bus_config *bus,
                    const struct db_drive_config *drive, const struct bus_timing *timing,
                    db_time now);

/* Parameters that the drive did not report: one bit for each parameter of the driver. */
void bus_log_missing_params(const struct db_log_source *log, const struct db_drive_config *drive,
                            const struct db_driver *driver, const uint64_t *params, db_time now);

/* A client's raw frame that was sent, or the answer to it; length 0: no answer. */
void bus_log_raw_frame(const struct db_log_source *log, const struct db_drive_config *drive,
                       enum db_medium medium, bool sent, const uint8_t *bytes, size_t length,
                       db_time now);

#endif
