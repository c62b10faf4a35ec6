/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The listening side: who may greet, whose greeting gives way, which client is connected with the
 * service, whose certificate is not good any more. One thread.
 */
#ifndef DRIVEBRIDGE_TLS_SERVER_H
#define DRIVEBRIDGE_TLS_SERVER_H

#include "drivebridge/time.h"
#include "tls/config.h"

#include <systemd/sd-event.h>

struct db_tls_server;

/* The configuration must outlive it. Null: it cannot listen, or a file is wrong; the log says so.
 */
struct db_tls_server *db_tls_server_new(sd_event *loop, const struct db_tls_config *config);
void db_tls_server_free(struct db_tls_server *server);

/* A db_program_renew_fn: reads its files again, certificates, key and lists of revoked
 * certificates. Wrong ones change nothing but the log. */
void db_tls_server_renew(void *context);

/* A db_program_turn_fn. */
db_time db_tls_server_turn(void *context, db_time now, int64_t us);

#endif
