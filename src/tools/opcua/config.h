/* SPDX-License-Identifier: Apache-2.0 */
/* The configuration file of drivebridge-opcua. Reads files and nothing else. */
#ifndef DRIVEBRIDGE_OPCUA_CONFIG_H
#define DRIVEBRIDGE_OPCUA_CONFIG_H

#include "opcua/model.h"
#include "reader/settings.h"

/* Indexes of words. */
enum { DB_OPCUA_OFF, DB_OPCUA_READ };
enum { DB_OPCUA_NO, DB_OPCUA_YES };
enum { DB_OPCUA_ALL };  /* show */
enum { DB_OPCUA_NONE }; /* reverse-connect */

/* Size of a token of the service's clock; longer ones are not valid. */
#define DB_OPCUA_TOKEN_MAX 64

struct db_opcua_config {
	char *socket;

	char *address; /* "": all */
	unsigned port; /* 0: any free port */
	char *gateway; /* never "" */
	unsigned interval_ms;
	struct db_setting_list show;
	struct db_setting_list reverse_connect;

	unsigned none;
	unsigned anonymous;
	char *pki;
	char *users;
	unsigned readers_may_stop;
	unsigned password_min_length;
	char *pam_folder; /* "": PAM's own */

	unsigned confirm_ms;
	unsigned silence_ms;

	unsigned sessions;
	unsigned subscriptions;
	unsigned items;
};

/* The table of all keys, the source of docs/opcua-keys.csv and the manual page. */
extern const struct db_setting db_opcua_keys[];

/* For db_settings_load() of a struct db_opcua_config. The context of its loading is the name of
 * this machine, which is the gateway's if none is given. */
extern const struct db_settings_form db_opcua_form;

/* The namespace of this gateway's nodes: its drives and buses have names that another gateway's may
 * have, too. */
#define DB_OPCUA_URI_MAX 128
void db_opcua_config_space(const struct db_opcua_config *config, char uri[DB_OPCUA_URI_MAX]);

/* What the server calls itself among others. */
void db_opcua_config_server(const struct db_opcua_config *config, char uri[DB_OPCUA_URI_MAX]);

/* True if this group of a drive's registers is shown. */
bool db_opcua_config_shows(const struct db_opcua_config *config, enum db_opcua_group group);

#endif
