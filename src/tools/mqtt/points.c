/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/points.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The metric of a drive whose values are one instance of a template. */
#define INSTANCE "drive"

/* DB_MQTT_NO_ALIAS without memory. */
static int64_t take_alias(struct db_mqtt_aliases *aliases, const char *owner, const char *name)
{
	json_t *names = json_object_get(aliases->known, owner);
	const json_t *known;

	if (!names) {
		names = json_object();
		if (json_object_set_new(aliases->known, owner, names) != 0)
			return DB_MQTT_NO_ALIAS;
	}
	known = json_object_get(names, name);
	if (known)
		return json_integer_value(known);
	if (json_object_set_new(names, name, json_integer(aliases->next)) != 0)
		return DB_MQTT_NO_ALIAS;
	return aliases->next++;
}

struct db_mqtt_points *db_mqtt_points_new(struct db_mqtt_aliases *aliases, const char *owner,
                                          const char *template)
{
	struct db_mqtt_points *points = calloc(1, sizeof(*points));

	if (!points)
		return NULL;
	points->aliases = aliases;
	points->quality = DB_MQTT_UNSAID;
	points->owner = strdup(owner);
	points->template = strdup(template);
	if (points->owner && points->template) {
		points->instance = template[0] ? take_alias(aliases, owner, INSTANCE) :
		                                 DB_MQTT_NO_ALIAS;
		return points;
	}
	db_mqtt_points_free(points);
	return NULL;
}

static void clear_point(struct db_mqtt_point *point)
{
	free(point->texts);
	json_decref(point->properties);
	json_decref(point->value);
}

void db_mqtt_points_free(struct db_mqtt_points *points)
{
	if (!points)
		return;
	for (size_t i = 0; i < points->count; i++)
		clear_point(&points->list[i]);
	free(points->list);
	free(points->owner);
	free(points->template);
	free(points);
}

struct db_mqtt_point *db_mqtt_points_find(const struct db_mqtt_points *points, const char *name,
                                          int64_t alias)
{
	for (size_t i = 0; i < points->count; i++) {
		if (name ? strcmp(points->list[i].name, name) == 0 : points->list[i].alias == alias)
			return &points->list[i];
	}
	return NULL;
}

bool db_mqtt_points_add(struct db_mqtt_points *points, const struct db_mqtt_point *point)
{
	struct db_mqtt_point *grown;
	struct db_mqtt_point added = *point;

	if (db_mqtt_points_find(points, point->name, 0)) {
		json_decref(point->properties);
		return true;
	}
	grown = reallocarray(points->list, points->count + 1, sizeof(*grown));
	if (grown)
		points->list = grown;
	if (asprintf(&added.texts, "%s%c%s%c%s", point->name, '\0', point->what ? point->what : "",
	             '\0', point->first ? point->first : "") < 0)
		added.texts = NULL;
	added.value = NULL;
	added.us = 0;
	added.changed = false;
	if (!grown || !added.texts) {
		clear_point(&added);
		return false;
	}
	added.name = added.texts;
	added.what = added.name + strlen(added.name) + 1;
	added.first = added.what + strlen(added.what) + 1;
	added.alias = point->named ? DB_MQTT_NO_ALIAS :
	                             take_alias(points->aliases, points->owner, added.name);
	points->list[points->count++] = added;
	return true;
}

void db_mqtt_points_set(struct db_mqtt_points *points, const char *name, json_t *value, int64_t us)
{
	struct db_mqtt_point *point = db_mqtt_points_find(points, name, 0);

	if (!point) {
		json_decref(value);
		return;
	}
	/* The result of a command is news, even if it is that of the one before. No value is what a
	 * point begins with. */
	if (point->kind == DB_MQTT_RESULT || !json_equal(point->value, value))
		point->changed = point->changed || point->value || !json_is_null(value);
	json_decref(point->value);
	point->value = value;
	point->us = us;
}

void db_mqtt_points_rate(struct db_mqtt_points *points, enum db_mqtt_quality quality)
{
	points->rated = points->rated || points->quality != quality;
	points->quality = quality;
}

/* Where the quality has changed, all values are news. */
static bool is_news(const struct db_mqtt_points *points, const struct db_mqtt_point *point)
{
	return point->changed || (points->rated && point->kind == DB_MQTT_VALUE);
}

bool db_mqtt_points_have_news(const struct db_mqtt_points *points)
{
	for (size_t i = 0; i < points->count; i++) {
		if (is_news(points, &points->list[i]))
			return true;
	}
	return false;
}

static void forget_news(struct db_mqtt_points *points)
{
	for (size_t i = 0; i < points->count; i++)
		points->list[i].changed = false;
	points->rated = false;
}

static bool is_member(const struct db_mqtt_points *points, const struct db_mqtt_point *point)
{
	return points->template[0] != '\0' && point->kind == DB_MQTT_VALUE;
}

/* Of a device: what the node has in common has none. */
static enum db_mqtt_quality quality_of(const struct db_mqtt_points *points,
                                       const struct db_mqtt_point *point)
{
	return point->kind == DB_MQTT_VALUE ? points->quality : DB_MQTT_UNSAID;
}

void db_mqtt_points_write_all(struct db_mqtt_points *points, struct db_mqtt_payload *payload,
                              int64_t us)
{
	bool whole = points->template[0] == '\0';

	/* Members first: all of them are in one metric. */
	for (int members = whole ? 0 : 1; members >= 0; members--) {
		if (members)
			db_mqtt_payload_begin(payload,
			                      &(struct db_mqtt_metric){
						      .name = INSTANCE,
						      .alias = points->instance,
						      .us = us,
						      .type = DB_MQTT_TEMPLATE,
						      .typed = true,
						      .quality = points->quality,
					      },
			                      points->template);
		for (size_t i = 0; i < points->count; i++) {
			const struct db_mqtt_point *point = &points->list[i];

			if (is_member(points, point) != (members == 1))
				continue;
			db_mqtt_payload_add(
				payload, &(struct db_mqtt_metric){
						 .name = point->name,
						 .alias = members ? DB_MQTT_NO_ALIAS : point->alias,
						 .us = point->us > 0 ? point->us : us,
						 .type = point->type,
						 .typed = true,
						 .value = point->value,
						 .quality = quality_of(points, point),
						 .properties = point->properties,
					 });
		}
		if (members)
			db_mqtt_payload_end(payload);
	}
	forget_news(points);
}

void db_mqtt_points_write_news(struct db_mqtt_points *points, struct db_mqtt_payload *payload)
{
	/* Where it is good and was, nothing is said of it. */
	bool told = points->rated || points->quality != DB_MQTT_GOOD;
	bool begun = false;

	for (size_t i = 0; i < points->count; i++) {
		const struct db_mqtt_point *point = &points->list[i];
		bool member = is_member(points, point);

		if (!is_news(points, point))
			continue;
		if (member && !begun)
			db_mqtt_payload_begin(payload,
			                      &(struct db_mqtt_metric){
						      .alias = points->instance,
						      .us = point->us,
						      .type = DB_MQTT_TEMPLATE,
						      .quality = DB_MQTT_UNSAID,
					      },
			                      points->template);
		else if (!member && begun)
			db_mqtt_payload_end(payload);
		begun = member;
		db_mqtt_payload_add(
			payload,
			&(struct db_mqtt_metric){
				.name = member || point->named ? point->name : NULL,
				.alias = member ? DB_MQTT_NO_ALIAS : point->alias,
				.us = point->us,
				.type = point->type,
				.value = point->value,
				.quality = told ? quality_of(points, point) : DB_MQTT_UNSAID,
			});
	}
	if (begun)
		db_mqtt_payload_end(payload);
	forget_news(points);
}

void db_mqtt_points_write_definition(const char *name, struct db_mqtt_points *const *points,
                                     size_t count, struct db_mqtt_payload *payload, int64_t us)
{
	json_t *written = json_object();

	db_mqtt_payload_begin(payload,
	                      &(struct db_mqtt_metric){ .name = name,
	                                                .alias = DB_MQTT_NO_ALIAS,
	                                                .us = us,
	                                                .type = DB_MQTT_TEMPLATE,
	                                                .typed = true,
	                                                .quality = DB_MQTT_UNSAID },
	                      NULL);
	for (size_t i = 0; i < count; i++) {
		for (size_t p = 0; p < points[i]->count; p++) {
			const struct db_mqtt_point *point = &points[i]->list[p];

			if (!is_member(points[i], point) ||
			    strcmp(points[i]->template, name) != 0 ||
			    json_object_get(written, point->name))
				continue;
			(void)json_object_set_new(written, point->name, json_true());
			db_mqtt_payload_add(payload, &(struct db_mqtt_metric){
							     .name = point->name,
							     .alias = DB_MQTT_NO_ALIAS,
							     .us = us,
							     .type = point->type,
							     .typed = true,
							     .quality = DB_MQTT_UNSAID,
							     .properties = point->properties,
						     });
		}
	}
	db_mqtt_payload_end(payload);
	json_decref(written);
}

bool db_mqtt_points_are_same(const struct db_mqtt_points *one, const struct db_mqtt_points *other)
{
	if (one->count != other->count || strcmp(one->template, other->template) != 0)
		return false;
	for (size_t i = 0; i < one->count; i++) {
		const struct db_mqtt_point *left = &one->list[i];
		const struct db_mqtt_point *right = &other->list[i];

		if (left->alias != right->alias || left->type != right->type ||
		    (left->properties != right->properties &&
		     !json_equal(left->properties, right->properties)))
			return false;
	}
	return true;
}
