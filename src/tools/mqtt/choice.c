/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/choice.h"

#include "client/log.h"
#include "client/plant.h"
#include "words/value.h"

#include <string.h>

static const char *const usual[] = {
	"axis_state",     "error",          "status",           "position", "velocity",
	"position_units", "velocity_units", "must_stand_cause", NULL
};

/* What every message has in addition to its values, or whose changes nobody needs. */
static const char *const frame[] = { "quality", "timestamp_us", "age_ms", NULL };

static bool is_one_of(const char *name, const char *const *names)
{
	while (*names && strcmp(*names, name) != 0)
		names++;
	return *names != NULL;
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
		const char *name = db_words_text(reg, "name");

		/* Process data come first, up to the first writable register. */
		process = process && !json_is_true(json_object_get(reg, "writable"));
		if (values->word == DB_SETTING_NAMED   ? db_setting_list_has(values, name) :
		    values->word == DB_MQTT_VALUES_ALL ? process && !is_one_of(name, frame) :
		                                         is_one_of(name, usual))
			(void)json_array_append(chosen, reg);
	}
	return chosen;
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
			if (!db_words_has_text(names, db_words_text(reg, "name")))
				(void)json_array_append(names, json_object_get(reg, "name"));
		}
		json_decref(chosen);
	}
	for (const char *at = config->values.names; at && *at; at += strlen(at) + 1) {
		if (!db_words_has_text(names, at))
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
