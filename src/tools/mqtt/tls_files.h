/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the library needs for TLS: the authorities that are trusted, and this client's certificate
 * and key. The library reads files for each connection; it gets copies in memory, so that a file
 * which is renewed half, or wrongly, is not read by chance. One thread.
 */
#ifndef DRIVEBRIDGE_MQTT_TLS_FILES_H
#define DRIVEBRIDGE_MQTT_TLS_FILES_H

#include "mqtt/config.h"

#include <stdint.h>

struct db_mqtt_tls_files;

/* The configuration has TLS on, and must outlive it. NULL: a file cannot be used; the log has the
 * reason. Freed with db_mqtt_tls_files_free(), NULL is allowed. */
struct db_mqtt_tls_files *db_mqtt_tls_files_new(const struct db_mqtt_config *config);
void db_mqtt_tls_files_free(struct db_mqtt_tls_files *files);

enum db_mqtt_tls_file {
	DB_MQTT_TLS_AUTHORITIES,
	DB_MQTT_TLS_CERTIFICATE,
	DB_MQTT_TLS_KEY,
	DB_MQTT_TLS_FILES
};

/* The path for the library; NULL: there is no such file. */
const char *db_mqtt_tls_files_path(const struct db_mqtt_tls_files *files,
                                   enum db_mqtt_tls_file file);

/* When the certificate ends, in seconds since 1970-01-01 UTC; 0: there is none. */
int64_t db_mqtt_tls_files_end(const struct db_mqtt_tls_files *files);

/* Reads the files again, for the next connection; what is not good stays as it was. Logs it. */
void db_mqtt_tls_files_renew(struct db_mqtt_tls_files *files);

/* To be called now and then: says in the log that the certificate ends. `us`: microseconds since
 * 1970-01-01 UTC. */
void db_mqtt_tls_files_look(struct db_mqtt_tls_files *files, int64_t us);

#endif
