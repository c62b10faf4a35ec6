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
		.usage = "usage: drivebridge-webd [--config FILE] [--page FOLDER] [--check]\n"
			 "       drivebridge-webd [--config FILE] --add-user NAME --role ROLE "
			 "[--drives LIST] [--pam]\n"
			 "       drivebridge-webd [--config FILE] --remove-user NAME | --users | "
			 "--move-users\n"
			 "  --config FILE       how to serve; " CONFIG_PATH " when not given\n"
			 "  --page FOLDER       the page's files, instead of what the file says\n"
			 "  --check             check the file, the users, the page and the "
			 "certificate, and end\n"
			 "  --add-user NAME     make a user, or give one another password, role "
			 "and drives;\n"
			 "                      the password is asked for, or the first line of "
			 "the input\n"
			 "  --role ROLE         observer, operator, engineer or administrator\n"
			 "  --drives LIST       names with commas, which the user may move; all "
			 "when not given\n"
			 "  --pam               PAM checks the password, by its service "
			 "drivebridge\n"
			 "  --remove-user NAME\n"
			 "  --users             list them\n"
			 "  --move-users        put those of web-users into the file of all "
			 "programs\n"
			 "  --help, --version\n",
		.form = &db_web_form,
		.keeper = &db_web_keeper,
		.users_at = offsetof(struct db_web_config, users_file),
		.least_at = offsetof(struct db_web_config, password_min_length),
		.option = "page",
		.option_at = offsetof(struct db_web_config, page),
		.check = check_files,
		.serve = db_web_serve,
	};

	return db_program_main(&program, argc, argv);
}
