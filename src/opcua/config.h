/* SPDX-License-Identifier: Apache-2.0 */
/* What drivebridge-opcua is told by its configuration file. Reads files and nothing else. */
#ifndef DRIVEBRIDGE_OPCUA_CONFIG_H
#define DRIVEBRIDGE_OPCUA_CONFIG_H

#include "opcua/model.h"
#include "reader/settings.h"

/* Positions of words. */
enum { DB_OPCUA_OFF, DB_OPCUA_READ };
enum { DB_OPCUA_ALL }; /* show */

/* Of a token of the service's clock; longer ones are none. */
#define DB_OPCUA_TOKEN_MAX 64

struct db_opcua_config {
	char *socket;

	char *address; /* "": all */
	unsigned port; /* 0: a free one */
	char *gateway; /* never "" */
	unsigned interval_ms;
	struct db_setting_list show;

	unsigned none;
	unsigned anonymous;
	char *pki;
	char *users;

	unsigned confirm_ms;
	unsigned silence_ms;

	unsigned sessions;
	unsigned subscriptions;
	unsigned items;
};

/*
 * Reads a file. False: it cannot be used. Errors and warnings go to `out`, "PATH:LINE: text" each. `host_name` is the
 * gateway's name where none is given. To be freed with db_opcua_config_free() in any case.
 */
bool db_opcua_config_load(const char *path, const char *host_name, FILE *out,
                          struct db_opcua_config *config);

/* The same from a text; `path` is for messages. */
bool db_opcua_config_parse(const char *text, const char *path, const char *host_name, FILE *out,
                           struct db_opcua_config *config);

/* Whether this group of a drive's registers is shown. */
bool db_opcua_config_shows(const struct db_opcua_config *config, enum db_opcua_group group);

void db_opcua_config_free(struct db_opcua_config *config);

#endif
