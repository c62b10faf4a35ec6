/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridge-webd: drives in a browser, and commands from users that the administrator made
 * operators. It is a client of the control socket of drivebridged and of nothing else.
 */
#include "client/clock.h"
#include "client/program.h"
#include "web/config.h"
#include "web/page.h"
#include "web/server.h"

#define CONFIG_PATH "/etc/drivebridge/web.conf"

static bool check_files(const void *values)
{
	const struct db_web_config *config = values;
	struct db_web_page *page = db_web_page_load(config->page);

	db_web_page_free(page);
	return page && (!config->tls ||
	                db_certificate_pair_check(config->certificate_file, config->key_file,
	                                          db_client_wall_us() / 1000000, stderr));
}

int main(int argc, char **argv)
{
	const struct db_program program = {
		.name = "drivebridge-webd",
		.path = CONFIG_PATH,
		.usage =
			"usage: drivebridge-webd [--config FILE] [--page FOLDER] [--check]\n"
			"       drivebridge-webd [--config FILE] --add-user NAME --role reader|operator\n"
			"       drivebridge-webd [--config FILE] --remove-user NAME\n"
			"  --config FILE       how to serve; " CONFIG_PATH " when not given\n"
			"  --page FOLDER       the page's files, instead of what the file says\n"
			"  --check             check the file, the users, the page and the certificate, and end\n"
			"  --add-user NAME     make a user, or give one another password and role;\n"
			"                      the password is asked for, or the first line of the input\n"
			"  --remove-user NAME\n"
			"  --help, --version\n",
		.form = &db_web_form,
		.keeper = &db_web_keeper,
		.users_at = offsetof(struct db_web_config, users_file),
		.option = "page",
		.option_at = offsetof(struct db_web_config, page),
		.check = check_files,
		.serve = db_web_serve,
	};

	return db_program_main(&program, argc, argv);
}
