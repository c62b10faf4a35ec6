/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/past.h"

#include "drivebridge/hash.h"

#include <string.h>

/* The zero at the end of the text counts, so that "ab", "c" and "a", "bc" differ. */
static uint64_t add_text(uint64_t key, const char *text)
{
	return db_hash_add(key, text, strlen(text) + 1);
}

uint64_t db_mqtt_past_key(const char *drive, const char *user, const char *id)
{
	uint64_t key = add_text(add_text(add_text(DB_HASH_BEGIN, drive), user), id);

	return key != 0 ? key : 1;
}

void db_mqtt_past_note(struct db_mqtt_past *past, uint64_t key, db_time now)
{
	struct db_mqtt_past_place *oldest = &past->places[0];

	for (size_t i = 0; i < DB_MQTT_PAST_PLACES; i++) {
		struct db_mqtt_past_place *place = &past->places[i];

		if (place->key == key) {
			oldest = place;
			break;
		}
		if (place->key == 0 ? oldest->key != 0 :
		                      oldest->key != 0 && place->seen < oldest->seen)
			oldest = place;
	}
	*oldest = (struct db_mqtt_past_place){ .key = key, .seen = now };
}

void db_mqtt_past_end_run(struct db_mqtt_past *past)
{
	for (size_t i = 0; i < DB_MQTT_PAST_PLACES; i++)
		past->places[i].over = true;
}

bool db_mqtt_past_had(struct db_mqtt_past *past, uint64_t key, db_time now)
{
	for (size_t i = 0; i < DB_MQTT_PAST_PLACES; i++) {
		struct db_mqtt_past_place *place = &past->places[i];

		if (place->key != key || !place->over || now - place->seen > DB_MQTT_PAST_LASTS)
			continue;
		place->seen = now;
		return true;
	}
	return false;
}
