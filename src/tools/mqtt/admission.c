/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/admission.h"

#include <stdio.h>

static bool is_allowed(const struct db_mqtt_config *config, const struct db_mqtt_command *command)
{
	if (!command->name)
		return config->parameters == DB_MQTT_ON;
	switch (config->allow.word) {
	case DB_MQTT_ALLOW_NONE:
		return false;
	case DB_MQTT_ALLOW_STOP:
		return command->stops;
	case DB_MQTT_ALLOW_ALL:
		return true;
	default:
		return db_setting_list_has(&config->allow, command->name);
	}
}

/* False with the reason: a role does not allow it. */
static bool may(const struct db_grant *grant, const struct db_mqtt_command *command,
                const char *drive, char why[DB_MQTT_REASON_MAX])
{
	const char *needed = drive;
	enum db_may needs = command->name ? db_may_of_command(command->name, &needed) : DB_MAY_MOVE;
	bool good = db_grant_has(grant, needs, needed);
	const char *name;
	json_t *value;

	json_object_foreach(command->name ? NULL : command->arguments, name, value)
	{
		if (!good)
			break;
		needs = db_may_of_write(drive, name, json_number_value(value));
		/* What is of no single drive needs all. */
		good = db_grant_has(grant, needs, drive);
	}
	if (!good)
		db_grant_explain(grant, needs, needed, why, DB_MQTT_REASON_MAX);
	return good;
}

/* A message sent before this program subscribed, or to an earlier run of the service, may have been
 * carried out then. */
static const char *judge_beginning(const struct db_mqtt_config *config,
                                   const struct db_mqtt_command *command,
                                   const struct db_mqtt_arrival *arrival,
                                   char why[DB_MQTT_REASON_MAX])
{
	bool subscribed = arrival->subscribed >= arrival->served;
	db_time since = arrival->now - (subscribed ? arrival->subscribed : arrival->served);
	const char *what = subscribed ? "this gateway's connection to the broker" :
	                                "the service was there";

	if (command->timed && arrival->us - command->us > since / DB_NS_PER_US) {
		snprintf(why, DB_MQTT_REASON_MAX, "it was sent before %s; are both clocks right?",
		         what);
		return "late";
	}
	/* The clock of a sender may be ahead by age-ms. */
	if (command->timed ? command->us <= arrival->newest_before : arrival->had) {
		snprintf(why, DB_MQTT_REASON_MAX,
		         command->timed ? "it was sent before what the service got before it began "
		                          "again; are both clocks right?" :
		                          "the service got one of this id before it began again");
		return "late";
	}
	if (!command->timed && since < config->age_ms * DB_NS_PER_MS) {
		snprintf(why, DB_MQTT_REASON_MAX,
		         "it does not say when it was sent, which may be before %s", what);
		return "late";
	}
	return NULL;
}

static const char *judge_age(const struct db_mqtt_config *config,
                             const struct db_mqtt_command *command,
                             const struct db_mqtt_arrival *arrival, char why[DB_MQTT_REASON_MAX])
{
	int64_t age_ms = (arrival->us - command->us) / 1000;

	if (arrival->now - arrival->sent_behind > config->age_ms * DB_NS_PER_MS) {
		snprintf(why, DB_MQTT_REASON_MAX,
		         "the connection to the broker stood still; the command may be older than "
		         "%u ms",
		         config->age_ms);
		return "late";
	}
	if (!command->timed && config->time == DB_MQTT_TIME_REQUIRED) {
		snprintf(why, DB_MQTT_REASON_MAX,
		         "it does not say when it was sent; add time, or set time = optional");
		return "bad_message";
	}
	if (!command->timed)
		return judge_beginning(config, command, arrival, why);
	if (age_ms > (int64_t)config->age_ms) {
		snprintf(why, DB_MQTT_REASON_MAX,
		         "it was sent %lld ms ago, %u ms are allowed; are both clocks right?",
		         (long long)age_ms, config->age_ms);
		return "late";
	}
	if (-age_ms > (int64_t)config->age_ms) {
		snprintf(why, DB_MQTT_REASON_MAX,
		         "its time is %lld ms ahead of this gateway's; are both clocks right?",
		         (long long)-age_ms);
		return "late";
	}
	return judge_beginning(config, command, arrival, why);
}

const char *db_mqtt_admission_judge(const struct db_mqtt_config *config,
                                    const struct db_mqtt_command *command,
                                    const struct db_mqtt_arrival *arrival,
                                    char why[DB_MQTT_REASON_MAX])
{
	const struct db_grant whole = { db_mqtt_config_role(config), true, "*" };

	why[0] = '\0';
	if (arrival->retained) {
		snprintf(why, DB_MQTT_REASON_MAX,
		         "a retained command is never carried out: it would be again with each "
		         "connection; publish it without retain");
		return "retained";
	}
	if (!is_allowed(config, command) ||
	    (config->command_drives.word == DB_SETTING_NAMED &&
	     !db_setting_list_has(&config->command_drives, arrival->drive))) {
		snprintf(why, DB_MQTT_REASON_MAX,
		         "the section command of this gateway's mqtt.conf does not allow it");
		return "not_allowed";
	}
	if (!may(&whole, command, arrival->drive, why) ||
	    !may(arrival->grant, command, arrival->drive, why))
		return "not_allowed";
	if (command->stops)
		return NULL;
	if (command->id[0] == '\0') {
		snprintf(
			why, DB_MQTT_REASON_MAX,
			"it has no id, without which one that comes twice cannot be told from two");
		return "bad_message";
	}
	return judge_age(config, command, arrival, why);
}

unsigned db_mqtt_admission_left_ms(const struct db_mqtt_config *config,
                                   const struct db_mqtt_command *command,
                                   const struct db_mqtt_arrival *arrival)
{
	int64_t age_ms = command->timed ? (arrival->us - command->us) / 1000 : 0;
	int64_t left_ms = (int64_t)config->age_ms - age_ms;

	return left_ms < 1 ? 1 : (unsigned)left_ms;
}
