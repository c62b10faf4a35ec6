/* SPDX-License-Identifier: Apache-2.0 */
/* What drivebridge-webd is told by its configuration file. Reads files and nothing else. */
#ifndef DRIVEBRIDGE_WEB_CONFIG_H
#define DRIVEBRIDGE_WEB_CONFIG_H

#include "reader/settings.h"
#include "users/users.h"

/* Of the file of users. */
extern const struct db_users_keeper db_web_keeper;

/* Positions of words. */
enum { DB_WEB_READ_USERS, DB_WEB_READ_ALL };
enum { DB_WEB_METRICS_LOCAL, DB_WEB_METRICS_NONE, DB_WEB_METRICS_ALL };

struct db_web_config {
	char *socket;

	char *listen; /* "ADDRESS:PORT", "[ADDRESS]:PORT" */
	char *certificate_file;
	char *key_file;
	struct db_setting_list hosts;
	struct db_setting_list proxies;
	char *page;
	unsigned connections;
	unsigned connections_per_address;

	char *users_file;
	unsigned read;
	unsigned session_idle_min;
	unsigned session_h;

	struct db_setting_list metrics_allow;

	char *certificate; /* what is in the files; NULL: no TLS */
	char *key;
};

/*
 * Reads a file and the certificate that it names. False: it cannot be used. Errors and warnings go to `out`,
 * "PATH:LINE: text" each. To be freed with db_web_config_free() in any case.
 */
bool db_web_config_load(const char *path, FILE *out, struct db_web_config *config);

/* The same from a text; `path` is for messages. */
bool db_web_config_parse(const char *text, const char *path, FILE *out,
                         struct db_web_config *config);

void db_web_config_free(struct db_web_config *config);

#endif
