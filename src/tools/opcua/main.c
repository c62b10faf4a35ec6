/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridge-opcua: the drives in the address space of an OPC UA server. It is a client of the
 * control socket of drivebridged and of nothing else.
 */
#include "client/program.h"
#include "opcua/login.h"
#include "opcua/security.h"
#include "opcua/server.h"

#include <stdlib.h>

#define CONFIG_PATH "/etc/drivebridge/opcua.conf"

static int serve(const void *config, sd_event *loop)
{
	struct db_opcua_server *server = db_opcua_server_new(loop, config);
	int status = server ? db_program_loop(loop, db_opcua_server_turn, db_opcua_server_renew,
	                                      server) :
	                      EXIT_FAILURE;

	db_opcua_server_free(server);
	return status;
}

static bool check_certificate(const void *config)
{
	return db_opcua_security_check(config);
}

int main(int argc, char **argv)
{
	const struct db_program program = {
		.name = "drivebridge-opcua",
		.path = CONFIG_PATH,
		.usage = "usage: drivebridge-opcua [--config FILE] [--check]\n"
			 "       drivebridge-opcua [--config FILE] --add-user NAME --role ROLE "
			 "[--drives LIST] [--pam]\n"
			 "       drivebridge-opcua [--config FILE] --remove-user NAME | --users | "
			 "--move-users\n"
			 "  --config FILE       what to serve to whom; " CONFIG_PATH
			 " when not given\n"
			 "  --check             check the file, the users and the certificate, and "
			 "end\n"
			 "  --add-user NAME     make a user, or give one another password, role "
			 "and drives;\n"
			 "                      the password is asked for, or a line of standard "
			 "input\n"
			 "  --role ROLE         observer, operator, engineer or administrator\n"
			 "  --drives LIST       names with commas, which the user may move; all "
			 "when not given\n"
			 "  --pam               PAM checks the password, by its service "
			 "drivebridge\n"
			 "  --remove-user NAME  take a user away\n"
			 "  --users             list them\n"
			 "  --move-users        put those of opcua-users into the file of all "
			 "programs\n"
			 "  --help, --version\n",
		.form = &db_opcua_form,
		.keeper = &db_opcua_keeper,
		.users_at = offsetof(struct db_opcua_config, users),
		.least_at = offsetof(struct db_opcua_config, password_min_length),
		.check = check_certificate,
		.serve = serve,
	};

	return db_program_main(&program, argc, argv);
}
