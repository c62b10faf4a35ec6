/* SPDX-License-Identifier: Apache-2.0 */
/* Any payload of a DCMD: it is a command whose parts are what they are to be, or what is wrong with it is said. What has
 * a stop among its metrics that can be read is a stop. */
#include "mqtt/order.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static struct db_mqtt_points *make_points(struct db_mqtt_aliases *aliases)
{
	static const struct db_mqtt_point all[] = {
		{ .name = "position", .what = "position", .type = DB_MQTT_INT32 },
		{ .name = "spd", .what = "spd", .type = DB_MQTT_FLOAT, .writable = true },
		{ .kind = DB_MQTT_RESULT, .name = "result/id", .type = DB_MQTT_STRING },
		{ .kind = DB_MQTT_RUN,
		  .name = "command/stop",
		  .what = "stop",
		  .type = DB_MQTT_BOOLEAN },
		{ .kind = DB_MQTT_RUN,
		  .name = "command/enable",
		  .what = "enable",
		  .type = DB_MQTT_BOOLEAN },
		{ .kind = DB_MQTT_RUN,
		  .name = "command/move_absolute",
		  .what = "move_absolute",
		  .first = "target_position",
		  .type = DB_MQTT_INT32 },
		{ .kind = DB_MQTT_ARGUMENT,
		  .name = "argument/target_velocity",
		  .what = "target_velocity",
		  .type = DB_MQTT_FLOAT },
		{ .kind = DB_MQTT_MARK, .name = "sender/id", .what = "id", .type = DB_MQTT_STRING },
		{ .kind = DB_MQTT_MARK,
		  .name = "sender/user",
		  .what = "user",
		  .type = DB_MQTT_STRING },
		{ .kind = DB_MQTT_MARK,
		  .name = "sender/token",
		  .what = "token",
		  .type = DB_MQTT_STRING },
		{ .kind = DB_MQTT_MARK,
		  .name = "sender/alive",
		  .what = "alive",
		  .type = DB_MQTT_BOOLEAN },
	};
	struct db_mqtt_points *points = db_mqtt_points_new(aliases, "lift", "");

	for (size_t i = 0; i < sizeof(all) / sizeof(all[0]); i++) {
		if (!db_mqtt_points_add(points, &all[i]))
			abort();
	}
	return points;
}

static void check(const struct db_mqtt_command *command, bool alive)
{
	if (!command->user || strlen(command->id) > DB_MQTT_ID_MAX || alive)
		abort();
	if (command->stops) {
		if (strcmp(command->name, "stop") != 0 || command->arguments)
			abort();
		return;
	}
	/* Never without an id and a time, and never what is no command or no register to write. */
	if (!command->id[0] || !command->timed || command->us <= 0)
		abort();
	if (command->name ? strcmp(command->name, "enable") != 0 &&
	                            strcmp(command->name, "move_absolute") != 0 :
	                    !json_is_real(json_object_get(command->arguments, "spd")))
		abort();
	if (command->name && strcmp(command->name, "move_absolute") == 0 &&
	    !json_is_integer(json_object_get(command->arguments, "target_position")))
		abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct db_mqtt_aliases aliases = { .known = json_object() };
	struct db_mqtt_points *points = make_points(&aliases);
	json_t *stops = json_pack("{s:b}", "stop", 1);
	struct db_mqtt_command command;
	const char *wrong;
	bool alive;

	if (!points)
		abort();
	wrong = db_mqtt_order_read(points, stops, data, size, &command, &alive);
	if (wrong && wrong[0] == '\0')
		abort();
	if (!wrong)
		check(&command, alive);
	(void)db_mqtt_order_asks(data, size, "Node Control/Rebirth");
	db_mqtt_command_clear(&command);
	json_decref(stops);
	db_mqtt_points_free(points);
	json_decref(aliases.known);
	return 0;
}
