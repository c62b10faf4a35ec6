/* SPDX-License-Identifier: Apache-2.0 */
/* The gateway's data for the forms of other programs, and functions that several forms share. Pure
 * but for printing. */
#ifndef DRIVEBRIDGE_CTL_CLIENTS_TEXT_H
#define DRIVEBRIDGE_CTL_CLIENTS_TEXT_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

/* The unit identifier that answers even when drives do not. */
#define DB_CTL_GATEWAY_UNIT 255

struct db_ctl_clients {
	char host[256]; /* without the port */
	unsigned port;
	bool low_word_first;
	const json_t *buses; /* of Describe */
	/* Also of Describe, those of one endpoint, in the order of their windows. */
	json_t *drives;
	json_t *gateway;   /* the gateway's own registers */
	json_t *windows;   /* those of the drives' windows */
	json_t *registers; /* registers of each drive, in the same order */
	json_t *scales;    /* counts_per_unit of each drive, null where it is not known */
	size_t chosen;     /* index of the named drive; the number of drives: all of them */
};

/* What the programs call a data type of the map. */
struct db_ctl_client_type {
	const char *type;
	unsigned registers;
	const char *telegraf;
	const char *exporter;
	const char *zabbix;
	const char *kepware;
	const char *ignition;      /* area of the address */
	const char *ignition_type; /* of the tag, wide enough for every value */
	const char *home;
	const char *tia;
	const char *logix;
	const char *sysmac;
};

/* NULL: a text or a bit. */
const struct db_ctl_client_type *db_ctl_client_type(const json_t *reg);

/* The next register of a drive's window (from 0) at or after `*at`; its name in the window goes to
 * `*name`. NULL: there is none. */
const json_t *db_ctl_next_of_window(const struct db_ctl_clients *of, size_t drive, size_t *at,
                                    const char **name);

const char *db_ctl_drive_name(const struct db_ctl_clients *of, size_t drive);
/* The drive's own register of that name, NULL: none. */
const json_t *db_ctl_drive_register(const struct db_ctl_clients *of, size_t drive,
                                    const char *name);
/* "" if the unit has no name. */
const char *db_ctl_unit_of(const json_t *reg);

/* Its description, followed by the names of its codes or bits. */
#define DB_CTL_DESCRIPTION_MAX 2048
void db_ctl_describe(const json_t *reg, char text[DB_CTL_DESCRIPTION_MAX]);

/* Figures of the gateway worth watching, in the order of their addresses; the names of the buses'
 * figures (from 1) begin with "bus". */
struct db_ctl_figure {
	const char *name;
	bool counter; /* it only increases */
};
extern const struct db_ctl_figure db_ctl_gateway_figures[];
extern const struct db_ctl_figure db_ctl_bus_figures[];
/* Of a bus (from 1) or, with 0, of the gateway; NULL where it does not exist. */
const json_t *db_ctl_figure(const struct db_ctl_clients *of, const struct db_ctl_figure *figure,
                            size_t bus);

/* In quotes, with the escapes of JSON, YAML and TOML. */
void db_ctl_put_quoted(FILE *out, const char *text);

/* The drive's name as an IEC 61131-3 identifier; if two would be equal, the later one gets its unit
 * appended. */
void db_ctl_put_identifier(FILE *out, const struct db_ctl_clients *of, size_t drive);

#endif
