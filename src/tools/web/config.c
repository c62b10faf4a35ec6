/* SPDX-License-Identifier: Apache-2.0 */
#include "web/config.h"
#include "web/address.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* A longer file is no certificate. */
#define PEM_MAX ((off_t)256 * 1024)

const struct db_users_keeper db_web_keeper = {
	.program = "drivebridge-webd",
	.former = DB_USERS_FORMER_WEB,
};

static char *read_file(struct db_settings *settings, const char *name, const char *path)
{
	unsigned line = db_settings_line(settings, "server", name);
	FILE *file = fopen(path, "re");
	char *text = NULL;
	struct stat status;

	if (!file || fstat(fileno(file), &status) != 0) {
		db_messages_add_error(settings->messages, line, "%s = %s: %s", name, path,
		                      strerror(errno));
	} else if (!S_ISREG(status.st_mode) || status.st_size > PEM_MAX || status.st_size == 0) {
		db_messages_add_error(settings->messages, line,
		                      "%s = %s is no file with a certificate or key in it", name,
		                      path);
	} else {
		text = calloc(1, (size_t)status.st_size + 1);
		if (!text || fread(text, 1, (size_t)status.st_size, file) != (size_t)status.st_size)
			db_messages_add_error(settings->messages, line, "%s = %s cannot be read",
			                      name, path);
	}
	if (file)
		(void)fclose(file);
	return text;
}

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

static void check_hosts(struct db_settings *settings, const struct db_setting_list *hosts)
{
	for (const char *at = hosts->names; at && *at; at += strlen(at) + 1) {
		if (at[strspn(at, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
		                  "0123456789-._")] != '\0')
			db_messages_add_error(
				settings->messages, db_settings_line(settings, "server", "hosts"),
				"hosts: %s is no host name; without a scheme, port or path", at);
	}
}

static void check_whole(struct db_settings *settings, const void *context)
{
	struct db_web_config *config = settings->values;
	struct sockaddr_storage endpoint;
	struct db_web_address address;
	socklen_t size;

	(void)context;
	check_networks(settings, "server", "proxies", &config->proxies);
	check_networks(settings, "metrics", "allow", &config->metrics_allow);
	check_hosts(settings, &config->hosts);
	db_settings_check_certificate(settings, "server", config->certificate_file,
	                              config->key_file);
	if (config->certificate_file[0] && config->key_file[0]) {
		/* gcc's analyzer does not see that the configuration has them. */
		config->certificate = read_file(settings, "certificate-file",
		                                config->certificate_file);
		config->key = read_file(settings, "key-file", config->key_file);
		db_settings_check_secret(settings, "server", "key-file", config->key_file,
		                         "drivebridge-web");
	}
	if (!db_web_endpoint_parse(config->listen, &endpoint, &size))
		db_messages_add_error(
			settings->messages, db_settings_line(settings, "server", "listen"),
			"listen = %s is no ADDRESS:PORT or [ADDRESS]:PORT", config->listen);
	else if (!config->certificate &&
	         db_web_address_of((struct sockaddr *)&endpoint, &address) &&
	         !db_web_address_is_local(&address))
		db_messages_add_warning(
			settings->messages, db_settings_line(settings, "server", "listen"),
			"without certificate-file passwords and commands go over the "
			"network as they are");
}

static void clear_key(void *values)
{
	struct db_web_config *config = values;

	if (config->key)
		explicit_bzero(config->key, strlen(config->key));
	free(config->key);
	free(config->certificate);
}

const struct db_settings_form db_web_form = {
	.keys = db_web_keys,
	.sections = "service, server, access and metrics",
	.size = sizeof(struct db_web_config),
	.check = check_whole,
	.clear = clear_key,
};
