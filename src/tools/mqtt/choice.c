/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/choice.h"

#include "client/log.h"
#include "client/plant.h"

#include <string.h>

static bool is_usual(const char *name)
{
	static const char *const usual[] = { "axis_state",     "error",           "status",
		                             "position",       "velocity",        "position_units",
		                             "velocity_units", "must_stand_cause" };

	for (size_t i = 0; i < sizeof(usual) / sizeof(usual[0]); i++) {
		if (strcmp(usual[i], name) == 0)
			return true;
	}
	return false;
}

/* What every message has in addition to its values, or whose changes nobody needs. */
static bool is_frame(const char *name)
{
	return strcmp(name, "quality") == 0 || strcmp(name, "timestamp_us") == 0 ||
	       strcmp(name, "age_ms") == 0;
}

json_t *db_mqtt_choose_registers(const struct db_mqtt_config *config, const json_t *registers)
{
	const struct db_setting_list *values = &config->values;
	json_t *chosen = json_array();
	bool process = true;
	size_t i;
	json_t *reg;

	json_array_foreach(registers, i, reg)
	{
		const char *name = db_client_text(reg, "name");

		/* Process data come first, up to the first writable register. */
		process = process && !json_is_true(json_object_get(reg, "writable"));
		if (values->word == DB_SETTING_NAMED   ? db_setting_list_has(values, name) :
		    values->word == DB_MQTT_VALUES_ALL ? process && !is_frame(name) :
		                                         is_usual(name))
			(void)json_array_append(chosen, reg);
	}
	return chosen;
}

void db_mqtt_choose_drives(const struct db_mqtt_config *config, json_t *drives)
{
	for (size_t i = json_array_size(drives);
	     config->drives.word == DB_SETTING_NAMED && i-- > 0;) {
		if (!db_setting_list_has(&config->drives,
		                         db_client_text(json_array_get(drives, i), "name")))
			(void)json_array_remove(drives, i);
	}
}

json_t *db_mqtt_collect_names(const struct db_mqtt_config *config,
                              const struct db_plant_drive *drives, size_t count)
{
	json_t *names = json_pack("[s,s]", "quality", "timestamp_us");

	for (size_t i = 0; i < count; i++) {
		json_t *chosen = db_mqtt_choose_registers(config, drives[i].registers);
		size_t place;
		const json_t *reg;

		json_array_foreach(chosen, place, reg)
		{
			if (!db_client_has_text(names, db_client_text(reg, "name")))
				(void)json_array_append(names, json_object_get(reg, "name"));
		}
		json_decref(chosen);
	}
	for (const char *at = config->values.names; at && *at; at += strlen(at) + 1) {
		if (!db_client_has_text(names, at))
			db_client_log(DB_CLIENT_WARNING, "values: no drive has a register '%s'",
			              at);
	}
	return names;
}

bool db_mqtt_choice_allows(const struct db_mqtt_config *config, const char *drive,
                           const char *command, bool stops)
{
	/* Where topics have a name in the end, those of buttons have none. */
	struct db_grant grant = { .role = config->senders == DB_MQTT_SENDERS_TOPIC ?
		                                  DB_ROLE_OBSERVER :
		                                  db_mqtt_config_role(config),
		                  .stops = true,
		                  .drives = "*" };
	const char *needed = drive;
	unsigned word = config->allow.word;
	bool allowed = word == DB_MQTT_ALLOW_ALL || (word == DB_MQTT_ALLOW_STOP && stops) ||
	               (word == DB_SETTING_NAMED && db_setting_list_has(&config->allow, command));

	return allowed && db_grant_has(&grant, db_may_of_command(command, &needed), needed) &&
	       (config->command_drives.word != DB_SETTING_NAMED ||
	        db_setting_list_has(&config->command_drives, drive));
}
