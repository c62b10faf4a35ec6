/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Records of the audit trail, as the service's method Audit answers them: in words for people, and
 * as lines of the Common Event Format for programs. Pure.
 */
#ifndef DRIVEBRIDGE_CAPTURE_AUDIT_TEXT_H
#define DRIVEBRIDGE_CAPTURE_AUDIT_TEXT_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

/* Whether it says that something was refused or failed. */
bool db_capture_audit_is_refused(const json_t *record);

/* "move_absolute target_position=6400", "write acc 100 -> 200": without control characters, to be
 * freed; NULL without memory. */
char *db_capture_audit_describe(const json_t *record);

/* By what a client came, as the words for who tell it: one of db_capture_audit_ways. */
const char *db_capture_audit_way(const json_t *record);

/* "page", "OPC UA", "MQTT", "control socket", "Modbus", "Modbus over TLS", "Modbus RTU",
 * "service"; ends with
 * NULL. */
extern const char *const db_capture_audit_ways[];

/* A whole line. */
void db_capture_audit_write_cef(const json_t *record, FILE *out);

#endif
