/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridge-webd: drives in a browser, and commands from there by whom the administrator has made an operator. A client
 * of the control socket of drivebridged and of nothing else.
 */
#include "client/log.h"
#include "drivebridge/version.h"
#include "users/administration.h"
#include "users/users.h"
#include "web/page.h"
#include "web/server.h"

#include <errno.h>
#include <getopt.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define CONFIG_PATH "/etc/drivebridge/web.conf"

/* From sysexits.h: the unit's RestartPreventExitStatus. */
#define EXIT_CONFIG 78

struct options {
	const char *config;
	const char *page;
	const char *add;
	const char *remove;
	enum db_role role; /* DB_ROLE_NONE: not given */
	bool check;
};

static void print_usage(FILE *out)
{
	(void)fputs(
		"usage: drivebridge-webd [--config FILE] [--page FOLDER] [--check]\n"
		"       drivebridge-webd [--config FILE] --add-user NAME --role reader|operator\n"
		"       drivebridge-webd [--config FILE] --remove-user NAME\n"
		"  --config FILE       how to serve; " CONFIG_PATH " when not given\n"
		"  --page FOLDER       the page's files, instead of what the file says\n"
		"  --check             check the file, the users and the page, and end\n"
		"  --add-user NAME     make a user, or give one another password and role;\n"
		"                      the password is asked for, or the first line of the input\n"
		"  --remove-user NAME\n"
		"  --help, --version\n",
		out);
}

/* -1 to go on, else the status to exit with. */
static int read_options(int argc, char **argv, struct options *options)
{
	static const struct option known[] = {
		{ "config", required_argument, NULL, 'c' },
		{ "page", required_argument, NULL, 'p' },
		{ "check", no_argument, NULL, 'k' },
		{ "add-user", required_argument, NULL, 'a' },
		{ "remove-user", required_argument, NULL, 'r' },
		{ "role", required_argument, NULL, 'o' },
		{ "help", no_argument, NULL, 'h' },
		{ "version", no_argument, NULL, 'v' },
		{ NULL, 0, NULL, 0 },
	};
	bool good = true;
	int option;

	while (good && (option = getopt_long(argc, argv, "", known, NULL)) != -1) {
		switch (option) {
		case 'c':
			options->config = optarg;
			break;
		case 'p':
			options->page = optarg;
			break;
		case 'k':
			options->check = true;
			break;
		case 'a':
			options->add = optarg;
			break;
		case 'r':
			options->remove = optarg;
			break;
		case 'o':
			good = db_role_read(optarg, &options->role);
			break;
		case 'h':
			print_usage(stdout);
			return EXIT_SUCCESS;
		case 'v':
			(void)puts("drivebridge-webd " DB_VERSION);
			return EXIT_SUCCESS;
		default:
			good = false;
		}
	}
	if (good && optind == argc && !(options->add && options->remove) &&
	    (options->add != NULL) == (options->role != DB_ROLE_NONE))
		return -1;
	print_usage(stderr);
	return 2;
}

/* --- serving ---------------------------------------------------------------------------------- */

static int check(const struct options *options, const struct db_web_config *config)
{
	struct db_users users;
	struct db_web_page *page = db_web_page_load(config->page);
	bool good = db_users_load(&users, config->users_file, &db_web_keeper, stderr) && page;

	if (good)
		(void)printf("%s: it is good; %zu users\n", options->config, users.count);
	db_users_clear(&users);
	db_web_page_free(page);
	return good ? EXIT_SUCCESS : EXIT_CONFIG;
}

int main(int argc, char **argv)
{
	struct options options = { .config = CONFIG_PATH };
	struct db_web_config config;
	int status = read_options(argc, argv, &options);
	sigset_t set;

	if (status >= 0)
		return status;
	if (!db_web_config_load(options.config, stderr, &config)) {
		db_web_config_free(&config);
		return EXIT_CONFIG;
	}
	if (options.page) {
		free(config.page);
		config.page = strdup(options.page);
	}
	if (options.add || options.remove) {
		status = db_users_administer(&db_web_keeper, config.users_file, options.add,
		                             options.remove, options.role);
	} else if (options.check) {
		status = check(&options, &config);
	} else {
		(void)signal(SIGPIPE, SIG_IGN);
		(void)sigemptyset(&set);
		(void)sigaddset(&set, SIGTERM);
		(void)sigaddset(&set, SIGINT);
		/* Before there is a thread. */
		(void)sigprocmask(SIG_BLOCK, &set, NULL);
		status = config.page ? db_web_serve(&config) : EXIT_FAILURE;
	}
	db_web_config_free(&config);
	return status;
}
