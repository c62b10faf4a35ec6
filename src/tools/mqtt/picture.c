/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/picture.h"

#include "mqtt/moment.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct db_mqtt_picture *db_mqtt_picture_new(const json_t *drive, const json_t *registers)
{
	struct db_mqtt_picture *picture = calloc(1, sizeof(*picture));
	size_t i;
	json_t *reg;

	if (!picture)
		return NULL;
	picture->drive = json_deep_copy(drive);
	picture->registers = json_object();
	picture->values = json_object();
	snprintf(picture->quality, sizeof(picture->quality), "bad");
	json_array_foreach(registers, i, reg)
	{
		const char *name = json_string_value(json_object_get(reg, "name"));

		if (name)
			(void)json_object_set_new(picture->registers, name, json_deep_copy(reg));
	}
	if (picture->drive && picture->registers && picture->values)
		return picture;
	db_mqtt_picture_free(picture);
	return NULL;
}

void db_mqtt_picture_free(struct db_mqtt_picture *picture)
{
	if (!picture)
		return;
	json_decref(picture->drive);
	json_decref(picture->registers);
	json_decref(picture->values);
	free(picture);
}

const char *db_mqtt_picture_name(const struct db_mqtt_picture *picture)
{
	const char *name = json_string_value(json_object_get(picture->drive, "name"));

	return name ? name : "";
}

char *db_mqtt_picture_dump(const json_t *json)
{
	return json_dumps(json, JSON_COMPACT | JSON_REAL_PRECISION(10));
}

/* A value of a register with this description in published form; the caller frees it. */
static json_t *word_of(const json_t *reg, const json_t *value)
{
	const json_t *codes = json_object_get(reg, "codes");
	const char *type = json_string_value(json_object_get(reg, "type"));
	bool bits = type && strncmp(type, "bits", 4) == 0;
	json_int_t code = json_integer_value(value);
	char number[24];
	json_t *name;
	json_t *names;

	if (!json_is_object(codes) || !json_is_integer(value))
		return json_deep_copy(value);
	snprintf(number, sizeof(number), "%lld", (long long)code);
	name = json_object_get(codes, number);
	if (!bits)
		return json_deep_copy(name ? name : value);
	/* The names of the set bits. */
	names = json_array();
	for (unsigned bit = 0; bit < 32; bit++) {
		if (((json_int_t)1 << bit & code) == 0)
			continue;
		snprintf(number, sizeof(number), "%u", bit);
		name = json_object_get(codes, number);
		if (name)
			(void)json_array_append(names, name);
		else
			(void)json_array_append_new(names, json_integer(bit));
	}
	return names;
}

char *db_mqtt_picture_write(const struct db_mqtt_picture *picture, json_t *values)
{
	json_t *message = json_pack("{s:o, s:s, s:O}", "time", db_mqtt_moment_describe(picture->us),
	                            "quality", picture->quality, "values", values);
	char *text = message ? db_mqtt_picture_dump(message) : NULL;

	json_decref(message);
	return text;
}

char *db_mqtt_picture_take(struct db_mqtt_picture *picture, const json_t *values, int64_t us)
{
	json_int_t taken = json_integer_value(json_object_get(values, "timestamp_us"));
	json_int_t number = json_integer_value(json_object_get(values, "quality"));
	/* OPC's codes. */
	const char *quality = number >= 192 ? "good" : number >= 64 ? "uncertain" : "bad";
	bool changed = strcmp(picture->quality, quality) != 0;
	json_t *changes = json_object();
	char *text = NULL;
	const char *name;
	json_t *reg;

	picture->us = taken > 0 ? taken : us;
	snprintf(picture->quality, sizeof(picture->quality), "%s", quality);
	json_object_foreach(picture->registers, name, reg)
	{
		const json_t *value = json_object_get(values, name);
		json_t *word = value ? word_of(reg, value) : json_null();

		if (word && !json_equal(word, json_object_get(picture->values, name))) {
			(void)json_object_set(changes, name, word);
			(void)json_object_set(picture->values, name, word);
			changed = true;
		}
		json_decref(word);
	}
	if (changed) {
		picture->changed = true;
		text = db_mqtt_picture_write(picture, changes);
	}
	json_decref(changes);
	return text;
}

bool db_mqtt_picture_state_is_due(struct db_mqtt_picture *picture, db_time interval,
                                  db_time refresh, db_time now)
{
	db_time wait = picture->changed ? interval : refresh;

	if (picture->published && now - picture->published_at < wait)
		return false;
	picture->published = true;
	picture->published_at = now;
	picture->changed = false;
	return true;
}

char *db_mqtt_picture_write_about(const struct db_mqtt_picture *picture)
{
	json_t *values = json_object();
	json_t *about;
	char *text;
	const char *name;
	json_t *reg;

	json_object_foreach(picture->registers, name, reg)
	{
		json_t *one = json_copy(reg);

		(void)json_object_del(one, "name");
		(void)json_object_set_new(values, name, one);
	}
	about = json_pack("{s:O?, s:O?, s:O?, s:o}", "drive",
	                  json_object_get(picture->drive, "name"), "bus",
	                  json_object_get(picture->drive, "bus"), "unit_name",
	                  json_object_get(picture->drive, "unit_name"), "values", values);
	text = about ? db_mqtt_picture_dump(about) : NULL;
	json_decref(about);
	return text;
}
