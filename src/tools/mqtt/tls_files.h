/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the library needs for TLS: the authorities that are trusted, and this client's certificate
 * and key. The library reads files for each connection; it gets copies in memory, so that a file
 * which is renewed half, or wrongly, is not read by chance. One thread.
 */
#ifndef DRIVEBRIDGE_MQTT_TLS_FILES_H
#define DRIVEBRIDGE_MQTT_TLS_FILES_H

#include "certificates/pair.h"
#include "mqtt/config.h"

enum db_mqtt_tls_file {
	DB_MQTT_TLS_AUTHORITIES,
	DB_MQTT_TLS_CERTIFICATE,
	DB_MQTT_TLS_KEY,
	DB_MQTT_TLS_FILES
};

/* A file of this process alone. */
struct db_mqtt_tls_copy {
	int fd; /* -1: there is none */
	char path[32];
};

struct db_mqtt_tls_files {
	const struct db_mqtt_config *config;
	struct db_certificate_file authorities;
	struct db_certificate_pair pair; /* this client's; its facts say when it ends */
	struct db_mqtt_tls_copy copies[DB_MQTT_TLS_FILES];
};

/* The configuration has TLS on, and must outlive it. NULL: a file cannot be used; the log has the
 * reason. Freed with db_mqtt_tls_files_free(), NULL is allowed. */
struct db_mqtt_tls_files *db_mqtt_tls_files_new(const struct db_mqtt_config *config);
void db_mqtt_tls_files_free(struct db_mqtt_tls_files *files);

/* The path for the library; NULL: there is no such file. */
const char *db_mqtt_tls_files_path(const struct db_mqtt_tls_files *files,
                                   enum db_mqtt_tls_file file);

/* Reads the files again, for the next connection; what is not good stays as it was. Logs it. */
void db_mqtt_tls_files_renew(struct db_mqtt_tls_files *files);

#endif
