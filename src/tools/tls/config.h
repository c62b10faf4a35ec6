/* SPDX-License-Identifier: Apache-2.0 */
/* The configuration file of drivebridge-tls. Reads it and nothing else. */
#ifndef DRIVEBRIDGE_TLS_CONFIG_H
#define DRIVEBRIDGE_TLS_CONFIG_H

#include "reader/settings.h"

/* Indexes of words. */
enum { DB_TLS_1_2, DB_TLS_1_3 };

struct db_tls_config {
	char *socket;

	char *address; /* "": all of the machine */
	unsigned port; /* 0: any free one */
	unsigned min_version;
	unsigned clients;
	unsigned clients_per_address;

	char *certificate_file;
	char *key_file;
	char *ca_file;
	char *crl_file; /* "": none */
};

/* The table of all keys, the source of docs/tls-keys.csv and the manual page. */
extern const struct db_setting db_tls_keys[];

/* For db_settings_load() of a struct db_tls_config. */
extern const struct db_settings_form db_tls_form;

#endif
