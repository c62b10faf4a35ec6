/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridge-webd: drives in a browser, and commands from there by whom the administrator has made an operator. A client
 * of the control socket of drivebridged and of nothing else.
 */
#include "client/options.h"
#include "users/administration.h"
#include "users/users.h"
#include "web/page.h"
#include "web/server.h"

#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define CONFIG_PATH "/etc/drivebridge/web.conf"

static const char usage[] =
	"usage: drivebridge-webd [--config FILE] [--page FOLDER] [--check]\n"
	"       drivebridge-webd [--config FILE] --add-user NAME --role reader|operator\n"
	"       drivebridge-webd [--config FILE] --remove-user NAME\n"
	"  --config FILE       how to serve; " CONFIG_PATH " when not given\n"
	"  --page FOLDER       the page's files, instead of what the file says\n"
	"  --check             check the file, the users and the page, and end\n"
	"  --add-user NAME     make a user, or give one another password and role;\n"
	"                      the password is asked for, or the first line of the input\n"
	"  --remove-user NAME\n"
	"  --help, --version\n";

static int check(const char *path, const struct db_web_config *config)
{
	struct db_users users;
	struct db_web_page *page = db_web_page_load(config->page);
	bool good = db_users_load(&users, config->users_file, &db_web_keeper, stderr) && page;

	if (good)
		(void)printf("%s: it is good; %zu users\n", path, users.count);
	db_users_clear(&users);
	db_web_page_free(page);
	return good ? EXIT_SUCCESS : DB_CLIENT_EXIT_CONFIG;
}

int main(int argc, char **argv)
{
	const char *path = CONFIG_PATH;
	const char *page = NULL;
	struct db_users_task task = { .add = NULL };
	bool checks = false;
	const struct db_client_option options[] = {
		{ .name = "config", .text = &path },
		{ .name = "page", .text = &page },
		{ .name = "check", .flag = &checks },
		{ .name = "add-user", .text = &task.add },
		{ .name = "remove-user", .text = &task.remove },
		{ .name = "role", .text = &task.role },
		{ .name = NULL },
	};
	struct db_web_config config;
	int status = db_client_options_read("drivebridge-webd", usage, options, argc, argv);
	sigset_t set;

	if (status >= 0)
		return status;
	if (!db_users_task_is_good(&task)) {
		(void)fputs(usage, stderr);
		return DB_CLIENT_EXIT_USAGE;
	}
	if (!db_web_config_load(path, stderr, &config)) {
		db_web_config_free(&config);
		return DB_CLIENT_EXIT_CONFIG;
	}
	if (page) {
		free(config.page);
		config.page = strdup(page);
	}
	if (task.add || task.remove) {
		status = db_users_administer(&db_web_keeper, config.users_file, &task);
	} else if (checks) {
		status = check(path, &config);
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
