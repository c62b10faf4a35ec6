/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/device.h"

#include "mqtt/choice.h"
#include "words/value.h"

#include <stdio.h>
#include <string.h>

#define GOOD_FROM 192
#define STATE_OFFLINE 0

json_t *db_mqtt_device_keep(const struct db_mqtt_config *config, json_t *received, bool commands)
{
	json_t *kept;
	json_t *chosen;
	size_t i;
	json_t *reg;

	if (commands)
		return db_mqtt_config_commands(config) ? json_incref(received) : json_null();
	/* Arguments of commands are writable, and no parameters. Their order stays, by which
	 * process data are known. */
	kept = json_array();
	chosen = db_mqtt_choose_registers(config, received);
	json_array_foreach(received, i, reg)
	{
		bool argument = json_is_true(json_object_get(reg, "writable")) &&
		                !json_is_true(json_object_get(reg, "parameter"));

		if (argument || db_words_look_up(chosen, db_words_text(reg, "name")))
			(void)json_array_append(kept, reg);
	}
	json_decref(chosen);
	return kept;
}

/* --- properties ------------------------------------------------------------------------------- */

/* "0=Offline, 1=Disabled", in the order of the interface. */
static json_t *write_codes(json_t *codes)
{
	char text[1024] = "";
	size_t used = 0;
	const char *code;
	const json_t *name;

	json_object_foreach(codes, code, name)
	{
		int length = snprintf(text + used, sizeof(text) - used, "%s%s=%s",
		                      used > 0 ? ", " : "", code, json_string_value(name));

		/* What does not fit is left out as a whole. */
		if (length < 0 || (size_t)length >= sizeof(text) - used) {
			text[used] = '\0';
			break;
		}
		used += (size_t)length;
	}
	return json_string(text);
}

static void put_number(json_t *properties, const char *key, const json_t *value)
{
	if (json_is_number(value))
		(void)json_object_set_new(properties, key, json_real(json_number_value(value)));
}

/* Of a register, as values and arguments have them: a new object. */
static json_t *describe_register(const json_t *reg)
{
	json_t *properties = json_object();
	const char *unit = db_words_text(reg, "unit");
	const char *text = db_words_text(reg, "description");

	if (unit[0])
		(void)json_object_set_new(properties, "engUnit", json_string(unit));
	put_number(properties, "engLow", json_object_get(reg, "min"));
	put_number(properties, "engHigh", json_object_get(reg, "max"));
	if (text[0])
		(void)json_object_set_new(properties, "documentation", json_string(text));
	if (json_is_object(json_object_get(reg, "codes")))
		(void)json_object_set_new(properties, "codes",
		                          write_codes(json_object_get(reg, "codes")));
	return properties;
}

/* --- points ----------------------------------------------------------------------------------- */

static bool add_value(struct db_mqtt_points *points, const struct db_mqtt_config *config,
                      const json_t *reg)
{
	bool writable = config->parameters == DB_MQTT_ON &&
	                json_is_true(json_object_get(reg, "writable"));

	return db_mqtt_points_add(points,
	                          &(struct db_mqtt_point){
					  .kind = DB_MQTT_VALUE,
					  .name = db_words_text(reg, "name"),
					  .what = db_words_text(reg, "name"),
					  .type = db_mqtt_type_of(db_words_text(reg, "type")),
					  .writable = writable,
					  .properties = describe_register(reg),
				  });
}

/* A command's value is that of its first argument; without one it is run by true. The other
 * arguments are metrics of their own. */
static bool add_command(struct db_mqtt_points *points, const json_t *registers,
                        const json_t *command)
{
	const json_t *arguments = json_object_get(command, "arguments");
	const char *first = json_string_value(json_array_get(arguments, 0));
	const json_t *reg = first ? db_words_look_up(registers, first) : NULL;
	json_t *properties = reg ? describe_register(reg) : json_object();
	char name[96];
	bool added;
	size_t i;
	const json_t *argument;

	(void)json_object_set(properties, "documentation", json_object_get(command, "description"));
	snprintf(name, sizeof(name), "command/%s", db_words_text(command, "name"));
	added = db_mqtt_points_add(
		points,
		&(struct db_mqtt_point){
			.kind = DB_MQTT_RUN,
			.name = name,
			.what = db_words_text(command, "name"),
			.type = reg ? db_mqtt_type_of(db_words_text(reg, "type")) : DB_MQTT_BOOLEAN,
			.first = reg ? first : "",
			.properties = properties,
		});
	json_array_foreach(arguments, i, argument)
	{
		const json_t *other = db_words_look_up(registers, json_string_value(argument));

		if (i == 0 || !other)
			continue;
		snprintf(name, sizeof(name), "argument/%s", db_words_text(other, "name"));
		added = db_mqtt_points_add(
				points,
				&(struct db_mqtt_point){
					.kind = DB_MQTT_ARGUMENT,
					.name = name,
					.what = db_words_text(other, "name"),
					.type = db_mqtt_type_of(db_words_text(other, "type")),
					.properties = describe_register(other),
				}) &&
		        added;
	}
	return added;
}

bool db_mqtt_device_add_common(struct db_mqtt_points *points, enum db_mqtt_point_kind kind)
{
	static const struct {
		enum db_mqtt_point_kind kind;
		const char *folder;
		const char *what;
		enum db_mqtt_type type;
		const char *text;
	} rows[] = {
		{ DB_MQTT_MARK, "sender", "id", DB_MQTT_STRING,
		  "With a command: its id; the same one is carried out once" },
		{ DB_MQTT_MARK, "sender", "user", DB_MQTT_STRING,
		  "With a command: who it is from; not checked" },
		{ DB_MQTT_MARK, "sender", "token", DB_MQTT_STRING,
		  "With a command: the newest token of the service's clock" },
		{ DB_MQTT_MARK, "sender", "alive", DB_MQTT_BOOLEAN,
		  "True, again and again: a motion without an end goes on" },
		{ DB_MQTT_RESULT, "result", "id", DB_MQTT_STRING,
		  "The id of the command: its own, or its time and name" },
		{ DB_MQTT_RESULT, "result", "command", DB_MQTT_STRING, "The command, or write" },
		{ DB_MQTT_RESULT, "result", "result", DB_MQTT_STRING, "How it ended, or pending" },
		{ DB_MQTT_RESULT, "result", "reason", DB_MQTT_STRING,
		  "Why it was not carried out" },
		{ DB_MQTT_RESULT, "result", "repeated", DB_MQTT_BOOLEAN,
		  "It was received before, and not carried out again" },
	};
	bool added = true;
	char name[96];

	for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]) && added; i++) {
		if (rows[i].kind != kind)
			continue;
		snprintf(name, sizeof(name), "%s/%s", rows[i].folder, rows[i].what);
		added = db_mqtt_points_add(
			points,
			&(struct db_mqtt_point){
				.kind = kind,
				.name = name,
				.what = rows[i].what,
				.type = rows[i].type,
				.properties = json_pack("{s:s}", "documentation", rows[i].text),
			});
	}
	return added;
}

struct db_mqtt_points *db_mqtt_device_new(const struct db_mqtt_config *config,
                                          struct db_mqtt_aliases *aliases,
                                          const struct db_plant_drive *drive, const char *family,
                                          const json_t *stops)
{
	const char *name = db_words_text(drive->description, "name");
	struct db_mqtt_points *points = db_mqtt_points_new(aliases, name,
	                                                   config->templates ? family : "");
	json_t *chosen = db_mqtt_choose_registers(config, drive->registers);
	bool added = points != NULL;
	bool commands = config->parameters == DB_MQTT_ON;
	size_t i;
	const json_t *one;

	json_array_foreach(chosen, i, one) added = added && add_value(points, config, one);
	json_array_foreach(drive->commands, i, one)
	{
		const char *command = db_words_text(one, "name");

		if (!db_mqtt_choice_allows(config, name, command, json_object_get(stops, command)))
			continue;
		commands = true;
		added = added && add_command(points, drive->registers, one);
	}
	if (commands)
		added = added && db_mqtt_device_add_common(points, DB_MQTT_MARK) &&
		        db_mqtt_device_add_common(points, DB_MQTT_RESULT);
	json_decref(chosen);
	if (added)
		return points;
	db_mqtt_points_free(points);
	return NULL;
}

/* --- what it does ----------------------------------------------------------------------------- */

bool db_mqtt_device_take(struct db_mqtt_points *points, const json_t *values, int64_t us)
{
	json_int_t taken = json_integer_value(json_object_get(values, "timestamp_us"));
	json_int_t quality = json_integer_value(json_object_get(values, "quality"));
	const json_t *state = json_object_get(values, "axis_state");

	/* With `stale = value` a drive that does not answer is uncertain, but its state tells. */
	if (quality == 0 || (json_is_integer(state) && json_integer_value(state) == STATE_OFFLINE))
		return false;
	db_mqtt_points_rate(points, quality >= GOOD_FROM ? DB_MQTT_GOOD : DB_MQTT_STALE);
	for (size_t i = 0; i < points->count; i++) {
		const struct db_mqtt_point *point = &points->list[i];
		json_t *value = json_object_get(values, point->what);

		if (point->kind == DB_MQTT_VALUE)
			db_mqtt_points_set(points, point->name,
			                   value ? json_incref(value) : json_null(),
			                   taken > 0 ? taken : us);
	}
	return true;
}

void db_mqtt_device_note(struct db_mqtt_points *points, const struct db_mqtt_outcome *outcome,
                         int64_t us)
{
	db_mqtt_points_set(points, "result/id", json_string(outcome->id), us);
	db_mqtt_points_set(points, "result/command", json_string(outcome->command), us);
	db_mqtt_points_set(points, "result/result", json_string(outcome->result), us);
	db_mqtt_points_set(points, "result/reason", json_string(outcome->why), us);
	db_mqtt_points_set(points, "result/repeated", json_boolean(outcome->repeated), us);
}
