/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/admission.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Ids that are remembered, of all drives together. So many commands within the time in which one that is sent twice
 * could come again are more than anybody wants. */
#define IDS_MAX 1024

struct seen {
	char drive[32];
	char id[DB_MQTT_ID_MAX + 1];
	db_time at;
};

struct db_mqtt_admission {
	const struct db_mqtt_config *config;
	struct seen seen[IDS_MAX]; /* a ring */
	size_t count;
	size_t next;
};

struct db_mqtt_admission *db_mqtt_admission_new(const struct db_mqtt_config *config)
{
	struct db_mqtt_admission *admission = calloc(1, sizeof(*admission));

	if (admission)
		admission->config = config;
	return admission;
}

void db_mqtt_admission_free(struct db_mqtt_admission *admission)
{
	free(admission);
}

static bool is_allowed(const struct db_mqtt_config *config, const struct db_mqtt_command *command)
{
	if (!command->name)
		return config->parameters == DB_MQTT_ON;
	switch (config->allow.word) {
	case DB_MQTT_ALLOW_NONE:
		return false;
	case DB_MQTT_ALLOW_STOP:
		return db_mqtt_command_is_stop(command);
	case DB_MQTT_ALLOW_ALL:
		return true;
	default:
		return db_setting_list_has(&config->allow, command->name);
	}
}

static const char *judge_age(const struct db_mqtt_config *config,
                             const struct db_mqtt_command *command,
                             const struct db_mqtt_arrival *arrival, char why[DB_MQTT_REASON_MAX])
{
	int64_t age_ms = (arrival->us - command->us) / 1000;

	if (arrival->now - arrival->sent_behind > config->age_ms * DB_NS_PER_MS) {
		(void)snprintf(
			why, DB_MQTT_REASON_MAX,
			"the connection to the broker stood still; the command may be older than "
			"%u ms",
			config->age_ms);
		return "late";
	}
	if (!command->timed && config->time == DB_MQTT_TIME_REQUIRED) {
		(void)snprintf(
			why, DB_MQTT_REASON_MAX,
			"it does not say when it was sent; add time, or set time = optional");
		return "bad_message";
	}
	if (!command->timed)
		return NULL;
	if (age_ms > (int64_t)config->age_ms) {
		(void)snprintf(why, DB_MQTT_REASON_MAX,
		               "it was sent %lld ms ago, %u ms are allowed; are both clocks right?",
		               (long long)age_ms, config->age_ms);
		return "late";
	}
	if (-age_ms > (int64_t)config->age_ms) {
		(void)snprintf(
			why, DB_MQTT_REASON_MAX,
			"its time is %lld ms ahead of this gateway's; are both clocks right?",
			(long long)-age_ms);
		return "late";
	}
	return NULL;
}

static bool was_seen(const struct db_mqtt_admission *admission, const char *drive, const char *id)
{
	for (size_t i = 0; i < admission->count; i++) {
		if (strcmp(admission->seen[i].id, id) == 0 &&
		    strcmp(admission->seen[i].drive, drive) == 0)
			return true;
	}
	return false;
}

/* False: none may be forgotten yet. */
static bool remember(struct db_mqtt_admission *admission, const char *drive, const char *id,
                     db_time now)
{
	struct seen *seen = &admission->seen[admission->next];

	if (admission->count == IDS_MAX &&
	    now - seen->at <= 2 * admission->config->age_ms * DB_NS_PER_MS)
		return false;
	(void)snprintf(seen->drive, sizeof(seen->drive), "%s", drive);
	(void)snprintf(seen->id, sizeof(seen->id), "%s", id);
	seen->at = now;
	admission->next = (admission->next + 1) % IDS_MAX;
	if (admission->count < IDS_MAX)
		admission->count++;
	return true;
}

const char *db_mqtt_admission_judge(struct db_mqtt_admission *admission,
                                    const struct db_mqtt_command *command,
                                    const struct db_mqtt_arrival *arrival,
                                    char why[DB_MQTT_REASON_MAX])
{
	const struct db_mqtt_config *config = admission->config;
	const char *refusal;

	why[0] = '\0';
	if (arrival->retained) {
		(void)snprintf(
			why, DB_MQTT_REASON_MAX,
			"a retained command is never carried out: it would be again with each "
			"connection; publish it without retain");
		return "retained";
	}
	if (!is_allowed(config, command) ||
	    (config->command_drives.word == DB_SETTING_NAMED &&
	     !db_setting_list_has(&config->command_drives, arrival->drive))) {
		(void)snprintf(why, DB_MQTT_REASON_MAX,
		               "the section command of this gateway's mqtt.conf does not allow it");
		return "not_allowed";
	}
	if (db_mqtt_command_is_stop(command))
		return NULL;
	if (command->id[0] == '\0') {
		(void)snprintf(
			why, DB_MQTT_REASON_MAX,
			"it has no id, without which one that comes twice cannot be told from two");
		return "bad_message";
	}
	if (was_seen(admission, arrival->drive, command->id)) {
		(void)snprintf(why, DB_MQTT_REASON_MAX, "there was a command with this id already");
		return "duplicate";
	}
	refusal = judge_age(config, command, arrival, why);
	if (!refusal && !remember(admission, arrival->drive, command->id, arrival->now)) {
		(void)snprintf(why, DB_MQTT_REASON_MAX, "too many commands; again later");
		refusal = "busy";
	}
	return refusal;
}
