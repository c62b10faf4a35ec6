/* SPDX-License-Identifier: Apache-2.0 */
/* A log that writes elsewhere, for tests. */
#ifndef DRIVEBRIDGE_LOG_LOG_H
#define DRIVEBRIDGE_LOG_LOG_H

#include "log/output.h"

/* Lines that may wait to be written. */
#define DB_LOG_QUEUE 64

/* `write` is called by the log's thread alone. */
int db_log_new_to(db_log_write_fn *write, void *context, struct db_log **log);

#endif
