/* SPDX-License-Identifier: Apache-2.0 */
/* What happens to drives, in words for the log: what it is and what to check. Internal to src/sched. */
#ifndef DRIVEBRIDGE_SCHED_BUS_LOG_H
#define DRIVEBRIDGE_SCHED_BUS_LOG_H

#include "drivebridge/axis.h"
#include "drivebridge/config.h"
#include "drivebridge/log.h"
#include "sched/engine.h"

void bus_log_event(const struct db_log_source *log, const struct db_drive_config *drive,
                   enum db_event event, const struct db_feedback *feedback, db_time now);

/* What came from a drive that does not answer, as it came. */
void bus_log_heard(const struct db_log_source *log, const struct db_drive_config *drive,
                   enum db_medium medium, const struct db_heard *heard, db_time now);

/* What a person should look at, for errors that ports are lost or cannot be opened with; "" when
 * there is nothing to say. */
const char *bus_log_port_advice(const struct db_bus_config *bus, int error);

/* A drive that answers later than the bus waits, or is asked sooner than it hears. */
void bus_log_timing(const struct db_log_source *log, const struct db_bus_config *bus,
                    const struct db_drive_config *drive, enum db_event event, db_time time,
                    db_time now);

/* Parameters that the drive did not tell: a bit for each of the driver's. */
void bus_log_missing_params(const struct db_log_source *log, const struct db_drive_config *drive,
                            const struct db_driver *driver, uint64_t params, db_time now);

/* A client's own frame that is sent, or what answered it; of length 0: nothing did. */
void bus_log_raw(const struct db_log_source *log, const struct db_drive_config *drive,
                 enum db_medium medium, bool sent, const uint8_t *bytes, size_t length,
                 db_time now);

#endif
