/* SPDX-License-Identifier: Apache-2.0 */
/* What a scan has found, as sections for the configuration. Pure. */
#ifndef DRIVEBRIDGE_SETUP_SECTIONS_H
#define DRIVEBRIDGE_SETUP_SECTIONS_H

#include <jansson.h>

/* A bus's key for its speed: baud of a serial line, bitrate on CAN. */
const char *db_setup_speed_key(const json_t *bus);

/*
 * Sections for the new drives among the finds of a bus (of `drives`, the configured ones, names and
 * units are taken), as a text that the caller frees; "" when there are none, NULL without memory. A
 * drive at another speed than the bus's follows a line that says what has to be changed first.
 */
char *db_setup_write_sections(const json_t *bus, const json_t *finds, const json_t *drives);

#endif
