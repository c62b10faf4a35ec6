/* SPDX-License-Identifier: Apache-2.0 */
/* Scans of the plant's buses by their names, for the control socket: its ops. Internal to src/service. */
#ifndef DRIVEBRIDGE_SERVICE_SCANS_H
#define DRIVEBRIDGE_SERVICE_SCANS_H

#include "drivebridge/scan.h"

int scans_begin(void *context, const char *bus, const struct db_scan_plan *plan, uint32_t *number);
bool scans_read(void *context, const char *bus, uint32_t number, struct db_scan_progress *progress);
const struct db_scan_find *scans_find(void *context, const char *bus, size_t index);
const struct db_scan_foreign *scans_foreign(void *context, const char *bus, size_t index);
void scans_cancel(void *context, const char *bus, uint32_t number);

#endif
