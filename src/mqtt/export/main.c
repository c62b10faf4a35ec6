/* SPDX-License-Identifier: Apache-2.0 */
/* mqtt-export: writes docs/mqtt-keys.csv, every key that a configuration of drivebridge-mqtt may have. */
#include "mqtt/keys.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

/* A field of CSV: quoted when it has to be. */
static void put_text(const char *text, char end)
{
	bool quoted = strpbrk(text, ",\"") != NULL;

	if (quoted)
		(void)putchar('"');
	for (; *text; text++) {
		if (*text == '"')
			(void)putchar('"');
		(void)putchar(*text);
	}
	if (quoted)
		(void)putchar('"');
	(void)putchar(end);
}

int main(void)
{
	static const char *const types[] = {
		[DB_MQTT_NUMBER] = "integer",
		[DB_MQTT_WORD] = "word",
		[DB_MQTT_TEXT] = "text",
		[DB_MQTT_LIST] = "list",
	};

	(void)puts("section,name,type,required,default,min,max,unit,words,families,description");
	for (const struct db_mqtt_key *key = db_mqtt_keys; key->name; key++) {
		put_text(key->section, ',');
		put_text(key->name, ',');
		put_text(types[key->kind], ',');
		put_text(key->preset ? "no" : "yes", ',');
		put_text(key->preset ? key->preset : "", ',');
		if (key->max > 0)
			(void)printf("%u,%u,", key->min, key->max);
		else
			(void)printf(",,");
		put_text(key->unit, ',');
		put_text(key->words, ',');
		/* The same columns as docs/config-keys.csv has. */
		put_text("all", ',');
		put_text(key->description, '\n');
	}
	return fflush(stdout) == 0 ? 0 : 1;
}
