/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The one table of what drivebridge-mqtt's configuration may say: reading it goes through the table row by row, and
 * docs/mqtt-keys.csv and the manual page come from it. Pure.
 */
#ifndef DRIVEBRIDGE_MQTT_KEYS_H
#define DRIVEBRIDGE_MQTT_KEYS_H

#include <stddef.h>

enum db_mqtt_kind {
	DB_MQTT_NUMBER, /* whole number, min..max, kept as unsigned */
	DB_MQTT_WORD,   /* one of `words`, kept as its position in an unsigned */
	DB_MQTT_TEXT,   /* min..max bytes, kept as char * */
	DB_MQTT_LIST, /* one of `words`, or a list of names in braces; kept as struct db_mqtt_list */
};

struct db_mqtt_key {
	const char *section;
	const char *name;
	enum db_mqtt_kind kind;
	/* As it would be written in a file. NULL: the key must be given; "": what holds then is not one value,
	 * `description` tells it. */
	const char *preset;
	unsigned min;
	unsigned max;
	const char *unit;  /* "" when it has none */
	const char *words; /* separated by spaces, "" when it has none */
	size_t offset;     /* in struct db_mqtt_config */
	const char *description;
};

/* Grouped by section; the last row has no name. */
extern const struct db_mqtt_key db_mqtt_keys[];

#endif
