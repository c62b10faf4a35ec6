/* SPDX-License-Identifier: Apache-2.0 */
#include "web/config.h"
#include "client/clock.h"
#include "web/address.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

const struct db_users_keeper db_web_keeper = {
	.program = "drivebridge-webd",
	.former = DB_USERS_FORMER_WEB,
};

static void check_networks(struct db_settings *settings, const char *section, const char *name,
                           const struct db_setting_list *list)
{
	for (const char *at = list->names; at && *at; at += strlen(at) + 1) {
		if (!db_web_network_is_good(at))
			db_messages_add_error(
				settings->messages, db_settings_line(settings, section, name),
				"%s: %s is no address and no network such as 192.168.10.0/24", name,
				at);
	}
}

static void check_whole(struct db_settings *settings, const void *context)
{
	struct db_web_config *config = settings->values;
	struct sockaddr_storage endpoint;
	struct db_web_address address;
	struct db_certificate_pair pair;
	char why[DB_CERTIFICATE_WHY];
	socklen_t size;

	(void)context;
	check_networks(settings, "server", "proxies", &config->proxies);
	check_networks(settings, "metrics", "allow", &config->metrics_allow);
	for (const char *at = config->hosts.names; at && *at; at += strlen(at) + 1) {
		if (at[strspn(at, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
		                  "0123456789-._")] != '\0')
			db_messages_add_error(
				settings->messages, db_settings_line(settings, "server", "hosts"),
				"hosts: %s is no host name; without a scheme, port or path", at);
	}
	db_settings_check_certificate(settings, "server", config->certificate_file,
	                              config->key_file);
	config->tls = config->certificate_file[0] && config->key_file[0];
	if (config->tls) {
		if (db_certificate_pair_load(&pair, config->certificate_file, config->key_file,
		                             db_client_wall_us() / 1000000,
		                             why) == DB_CERTIFICATE_WRONG)
			db_messages_add_error(
				settings->messages,
				db_settings_line(settings, "server", "certificate-file"), "%s",
				why);
		db_certificate_pair_clear(&pair);
		db_settings_check_secret(settings, "server", "key-file", config->key_file,
		                         "drivebridge-web");
	}
	if (!db_web_endpoint_parse(config->listen, &endpoint, &size))
		db_messages_add_error(
			settings->messages, db_settings_line(settings, "server", "listen"),
			"listen = %s is no ADDRESS:PORT or [ADDRESS]:PORT", config->listen);
	else if (!config->tls && db_web_address_of((struct sockaddr *)&endpoint, &address) &&
	         !db_web_address_is_local(&address))
		db_messages_add_warning(
			settings->messages, db_settings_line(settings, "server", "listen"),
			"without certificate-file passwords and commands go over the "
			"network as they are");
}

const struct db_settings_form db_web_form = {
	.keys = db_web_keys,
	.sections = "service, server, access and metrics",
	.size = sizeof(struct db_web_config),
	.check = check_whole,
};
