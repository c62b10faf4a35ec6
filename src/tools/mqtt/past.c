/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/past.h"

/* FNV-1a, with the zero behind each text. */
static uint64_t add_text(uint64_t key, const char *text)
{
	do {
		key = (key ^ (unsigned char)*text) * UINT64_C(0x100000001B3);
	} while (*text++);
	return key;
}

uint64_t db_mqtt_past_key(const char *drive, const char *user, const char *id)
{
	uint64_t key = add_text(add_text(add_text(UINT64_C(0xCBF29CE484222325), drive), user), id);

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
