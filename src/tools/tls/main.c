/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridge-tls: Modbus/TCP Security in front of drivebridged. It verifies clients' certificates,
 * and passes their Modbus on to the secure socket of the service, with who they are; what they may
 * is decided there.
 */
#include "certificates/certificate.h"
#include "client/clock.h"
#include "client/log.h"
#include "client/program.h"
#include "tls/server.h"
#include "tls/trust.h"

#include <stdio.h>
#include <stdlib.h>

#define CONFIG_PATH "/etc/drivebridge/tls.conf"

/* --check: the files that the configuration names. */
static bool check(const void *values)
{
	char why[DB_TLS_WHY];
	char doubt[DB_TLS_WHY];
	char date[DB_CERTIFICATE_DATE];
	struct db_tls_trust *trust = db_tls_trust_load(values, db_client_wall_us() / 1000000, why,
	                                               doubt);

	if (!trust) {
		fprintf(stderr, "%s\n", why);
		return false;
	}
	if (doubt[0] != '\0')
		fprintf(stderr, "%s\n", doubt);
	db_certificate_write_date(trust->expires, date);
	printf("the certificate is valid until %s\n", date);
	db_tls_trust_let_go(trust);
	return doubt[0] == '\0';
}

static int serve(const void *config, sd_event *loop)
{
	struct db_tls_server *server = db_tls_server_new(loop, config);
	int status = EXIT_FAILURE;

	if (server)
		status = db_program_loop(loop, db_tls_server_turn, db_tls_server_renew, server);
	db_tls_server_free(server);
	return status;
}

int main(int argc, char **argv)
{
	const struct db_program program = {
		.name = "drivebridge-tls",
		.path = CONFIG_PATH,
		.usage = "usage: drivebridge-tls [--config FILE] [--check]\n"
			 "  --config FILE  where to listen, and the certificates; " CONFIG_PATH
			 " when not given\n"
			 "  --check        check the file, the certificates and the key, and end\n"
			 "  --help, --version\n",
		.form = &db_tls_form,
		.check = check,
		.serve = serve,
	};

	return db_program_main(&program, argc, argv);
}
