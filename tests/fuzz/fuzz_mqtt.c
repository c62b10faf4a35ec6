/* SPDX-License-Identifier: Apache-2.0 */
/* Any message from a broker: it is a command whose parts are what they are to be, or what is wrong with it is said; and
 * what nobody allowed is not carried out. */
#include "mqtt/admission.h"

#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void check_judgement(const struct db_mqtt_command *command)
{
	struct db_mqtt_config config = { .age_ms = 2000,
		                         .allow = { .word = DB_MQTT_ALLOW_STOP },
		                         .role = DB_MQTT_ROLE_ENGINEER };
	struct db_grant grant = { .role = DB_ROLE_ENGINEER, .stops = true, .drives = "*" };
	struct db_mqtt_arrival arrival = { .drive = "lift", .grant = &grant };
	char why[DB_MQTT_REASON_MAX];

	if (!db_mqtt_admission_judge(&config, command, &arrival, why) && !command->stops)
		abort();
	config.allow.word = DB_MQTT_ALLOW_ALL;
	config.parameters = DB_MQTT_ON;
	if (!db_mqtt_admission_judge(&config, command, &arrival, why) && !command->stops) {
		/* It had an id and the time of now. */
		if (!command->id[0] || !command->timed ||
		    db_mqtt_admission_left_ms(&config, command, &arrival) > 2 * config.age_ms)
			abort();
	}
	/* An observer only stops. */
	grant.role = DB_ROLE_OBSERVER;
	if (!db_mqtt_admission_judge(&config, command, &arrival, why) && !command->stops)
		abort();
	arrival.retained = true;
	if (!db_mqtt_admission_judge(&config, command, &arrival, why))
		abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct db_mqtt_command command;
	json_t *stops = json_pack("{s:b, s:b, s:b}", "stop", 1, "quick_stop", 1, "disable", 1);
	const char *wrong = db_mqtt_command_parse((const char *)data, size, stops, &command);

	if (wrong && wrong[0] == '\0')
		abort();
	if (!wrong) {
		if (strlen(command.id) > DB_MQTT_ID_MAX ||
		    (command.arguments && !json_is_object(command.arguments)) ||
		    (!command.name && !command.arguments) || (command.timed && command.us < 0))
			abort();
		check_judgement(&command);
	}
	db_mqtt_command_clear(&command);
	json_decref(stops);
	return 0;
}
