/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridge-webd: drives in a browser, and commands from there by whom the administrator has made an operator. A client
 * of the control socket of drivebridged and of nothing else.
 */
#include "client/log.h"
#include "drivebridge/version.h"
#include "web/page.h"
#include "web/server.h"
#include "web/users.h"

#include <errno.h>
#include <getopt.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#define CONFIG_PATH "/etc/drivebridge/web.conf"

/* From sysexits.h: the unit's RestartPreventExitStatus. */
#define EXIT_CONFIG 78

struct options {
	const char *config;
	const char *page;
	const char *add;
	const char *remove;
	enum db_web_role role; /* DB_WEB_NONE: not given */
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
			good = db_web_user_role(optarg, &options->role);
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
	    (options->add != NULL) == (options->role != DB_WEB_NONE))
		return -1;
	print_usage(stderr);
	return 2;
}

/* --- users ------------------------------------------------------------------------------------ */

/* A line without its end. False: there is none, or it is too long. */
static bool read_line(const char *prompt, char *line, size_t size)
{
	struct termios before;
	bool terminal = isatty(STDIN_FILENO) && tcgetattr(STDIN_FILENO, &before) == 0;
	bool good;

	if (terminal) {
		struct termios silent = before;

		(void)fputs(prompt, stderr);
		silent.c_lflag &= ~(tcflag_t)ECHO;
		(void)tcsetattr(STDIN_FILENO, TCSAFLUSH, &silent);
	}
	good = fgets(line, (int)size, stdin) && strchr(line, '\n');
	line[strcspn(line, "\r\n")] = '\0';
	if (terminal) {
		(void)tcsetattr(STDIN_FILENO, TCSAFLUSH, &before);
		(void)fputs("\n", stderr);
	}
	return good || (line[0] != '\0' && feof(stdin));
}

static bool read_password(char *password, size_t size)
{
	char again[DB_WEB_PASSWORD_MAX + 2] = "";
	bool good = read_line("Password: ", password, size);

	if (!good || strlen(password) < DB_WEB_PASSWORD_MIN) {
		(void)fprintf(stderr, "drivebridge-webd: a password has %d to %d bytes\n",
		              DB_WEB_PASSWORD_MIN, DB_WEB_PASSWORD_MAX);
		return false;
	}
	if (isatty(STDIN_FILENO) && (!read_line("The same again: ", again, sizeof(again)) ||
	                             strcmp(password, again) != 0)) {
		(void)fputs("drivebridge-webd: these are two different passwords\n", stderr);
		good = false;
	}
	explicit_bzero(again, sizeof(again));
	return good;
}

static int change_user(const struct options *options, const char *path)
{
	char password[DB_WEB_PASSWORD_MAX + 2] = "";
	struct db_web_user user = { .role = options->role };
	bool good = true;

	if (options->add && !db_web_user_name_is_good(options->add)) {
		(void)fprintf(
			stderr,
			"drivebridge-webd: a name has 1 to %d letters, digits, '.', '-' and '_', "
			"a letter or digit first\n",
			DB_WEB_NAME_MAX);
		return 2;
	}
	if (options->add) {
		good = read_password(password, sizeof(password));
		if (good && !db_web_users_hash(password, user.hash, sizeof(user.hash))) {
			(void)fprintf(stderr, "drivebridge-webd: no hash: %s\n", strerror(errno));
			good = false;
		}
		explicit_bzero(password, sizeof(password));
	}
	if (good)
		good = db_web_users_change(path, options->add ? options->add : options->remove,
		                           options->role, options->add ? user.hash : NULL, stderr);
	explicit_bzero(&user, sizeof(user));
	return good ? EXIT_SUCCESS : EXIT_FAILURE;
}

/* --- serving ---------------------------------------------------------------------------------- */

static int check(const struct options *options, const struct db_web_config *config)
{
	struct db_web_users users;
	struct db_web_page *page = db_web_page_load(config->page);
	bool good = db_web_users_load(&users, config->users_file, stderr) && page;

	if (good)
		(void)printf("%s: it is good; %zu users\n", options->config, users.count);
	db_web_users_clear(&users);
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
		status = change_user(&options, config.users_file);
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
