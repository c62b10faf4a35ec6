/* SPDX-License-Identifier: Apache-2.0 */
/* The configuration file of drivebridge-webd. Reads files and nothing else. */
#ifndef DRIVEBRIDGE_WEB_CONFIG_H
#define DRIVEBRIDGE_WEB_CONFIG_H

#include "certificates/pair.h"
#include "reader/settings.h"
#include "users/users.h"

/* For the file of users. */
extern const struct db_users_keeper db_web_keeper;

/* Indexes of words. */
enum { DB_WEB_READ_USERS, DB_WEB_READ_ALL };
enum { DB_WEB_NO, DB_WEB_YES };
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
	unsigned hsts_days;

	char *users_file;
	unsigned read;
	unsigned readers_may_stop;
	unsigned password_min_length;
	char *pam_folder; /* "": PAM's own */
	unsigned session_idle_min;
	unsigned session_h;

	struct db_setting_list metrics_allow;

	bool tls; /* there is a certificate */
};

/* The table of all keys, the source of docs/web-keys.csv and the manual page. */
extern const struct db_setting db_web_keys[];

/* For db_settings_load() of a struct db_web_config. Looks at the certificate that it names, too. */
extern const struct db_settings_form db_web_form;

#endif
