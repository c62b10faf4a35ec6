/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/senders.h"
#include "users/users.h"

#include <stdlib.h>

static const struct db_users_keeper keeper = { .program = "drivebridge-mqtt" };

struct db_mqtt_senders {
	const struct db_mqtt_config *config;
	struct db_users users;
	uint64_t stamp; /* of the file that they are from */
};

static void read_users(struct db_mqtt_senders *senders, uint64_t stamp)
{
	senders->stamp = stamp;
	db_users_clear(&senders->users);
	/* If the file cannot be read, there are no users. */
	if (!db_users_load(&senders->users, senders->config->users_file, &keeper, stderr))
		db_users_clear(&senders->users);
}

struct db_mqtt_senders *db_mqtt_senders_new(const struct db_mqtt_config *config)
{
	struct db_mqtt_senders *senders = calloc(1, sizeof(*senders));

	if (!senders)
		return NULL;
	senders->config = config;
	/* Whatever is wrong with the file is to be said at the start. */
	if (config->senders == DB_MQTT_SENDERS_TOPIC)
		read_users(senders, db_users_stamp(config->users_file, &keeper));
	return senders;
}

void db_mqtt_senders_free(struct db_mqtt_senders *senders)
{
	if (!senders)
		return;
	db_users_clear(&senders->users);
	free(senders);
}

struct db_grant db_mqtt_senders_grant(struct db_mqtt_senders *senders, const char *sender)
{
	struct db_grant grant = { .role = DB_ROLE_OBSERVER, .stops = true, .drives = "*" };
	const struct db_user *user;
	uint64_t stamp;

	if (senders->config->senders == DB_MQTT_SENDERS_OFF) {
		grant.role = db_mqtt_config_role(senders->config);
		return grant;
	}
	stamp = db_users_stamp(senders->config->users_file, &keeper);
	if (stamp != senders->stamp)
		read_users(senders, stamp);
	user = sender[0] ? db_users_find(&senders->users, sender) : NULL;
	if (user)
		grant = user->grant;
	grant.stops = true;
	return grant;
}
