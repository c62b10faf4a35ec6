/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/config.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The gateway's name is part of a URI and of a certificate's subject. */
static bool is_name(const char *text)
{
	for (; *text; text++) {
		if (!isalnum((unsigned char)*text) && !strchr("-._", *text))
			return false;
	}
	return true;
}

/* "opc.tcp://10.0.0.7:4844" or "opc.tcp://[fd00::7]:4844". A name would have to be resolved, which
 * takes the time of everybody's stops. */
static bool is_url(const char *url)
{
	static const char head[] = "opc.tcp://";
	char host[INET6_ADDRSTRLEN];
	unsigned char address[sizeof(struct in6_addr)];
	unsigned long port;
	size_t length;
	bool six;
	char *end;

	if (strncmp(url, head, sizeof(head) - 1) != 0)
		return false;
	url += sizeof(head) - 1;
	six = *url == '[';
	url += six;
	length = strcspn(url, six ? "]" : ":");
	if (length >= sizeof(host))
		return false;
	memcpy(host, url, length);
	host[length] = '\0';
	url += length;
	if (inet_pton(six ? AF_INET6 : AF_INET, host, address) != 1 || (six && *url++ != ']') ||
	    *url++ != ':' || !isdigit((unsigned char)*url))
		return false;
	port = strtoul(url, &end, 10);
	return *end == '\0' && port > 0 && port <= UINT16_MAX;
}

static void check_whole(struct db_settings *settings, const void *host_name)
{
	struct db_opcua_config *config = settings->values;

	if (config->gateway && config->gateway[0] == '\0') {
		free(config->gateway);
		config->gateway = strdup(host_name);
	}
	if (!config->gateway)
		db_messages_add_error(settings->messages, 0,
		                      "out of memory; free some and try again");
	else if (!is_name(config->gateway))
		db_messages_add_error(settings->messages,
		                      db_settings_line(settings, "server", "gateway"),
		                      "gateway = %s cannot be a part of a certificate: letters, "
		                      "digits, - . and _ only",
		                      config->gateway);
	for (const char *at = config->show.names; at && *at; at += strlen(at) + 1) {
		bool known = false;

		for (int group = DB_OPCUA_COMMAND; group < DB_OPCUA_DIAGNOSIS; group++)
			known = known ||
			        strcmp(db_opcua_group_folder((enum db_opcua_group)group), at) == 0;
		if (!known)
			db_messages_add_error(settings->messages,
			                      db_settings_line(settings, "server", "show"),
			                      "show has '%s'; there are CommandBlock, Parameters, "
			                      "Service, Bits and History",
			                      at);
	}
	for (const char *at = config->reverse_connect.names; at && *at; at += strlen(at) + 1) {
		if (!is_url(at))
			db_messages_add_error(
				settings->messages,
				db_settings_line(settings, "server", "reverse-connect"),
				"reverse-connect has '%s'; write an address as numbers with its "
				"port, as in opc.tcp://10.0.0.7:4844",
				at);
	}
	if (config->anonymous == DB_OPCUA_READ)
		db_messages_add_warning(
			settings->messages, db_settings_line(settings, "security", "anonymous"),
			"with anonymous = read everybody who reaches the port reads");
}

const struct db_settings_form db_opcua_form = {
	.keys = db_opcua_keys,
	.sections = "service, server, security, commands and limits",
	.size = sizeof(struct db_opcua_config),
	.check = check_whole,
};

void db_opcua_config_space(const struct db_opcua_config *config, char uri[DB_OPCUA_URI_MAX])
{
	snprintf(uri, DB_OPCUA_URI_MAX, "urn:%s:drivebridge:drives", config->gateway);
}

void db_opcua_config_server(const struct db_opcua_config *config, char uri[DB_OPCUA_URI_MAX])
{
	snprintf(uri, DB_OPCUA_URI_MAX, "urn:%s:drivebridge", config->gateway);
}

bool db_opcua_config_shows(const struct db_opcua_config *config, enum db_opcua_group group)
{
	return group == DB_OPCUA_PROCESS || group == DB_OPCUA_DIAGNOSIS ||
	       config->show.word == DB_OPCUA_ALL ||
	       db_setting_list_has(&config->show, db_opcua_group_folder(group));
}
