/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridge-opcua: the drives in the address space of an OPC UA server. A client of the control socket of
 * drivebridged and of nothing else.
 */
#include "client/log.h"
#include "drivebridge/version.h"
#include "opcua/access.h"
#include "opcua/server.h"
#include "users/administration.h"

#include <errno.h>
#include <getopt.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/signalfd.h>
#include <systemd/sd-daemon.h>
#include <time.h>
#include <unistd.h>

#define CONFIG_PATH "/etc/drivebridge/opcua.conf"

/* From sysexits.h: the unit's RestartPreventExitStatus. */
#define EXIT_CONFIG 78

/* The loop goes around at least so often, for the watchdog of systemd. */
#define TURN_MAX (1 * DB_NS_PER_S)

struct options {
	const char *config;
	const char *add;
	const char *remove;
	enum db_role role; /* DB_ROLE_NONE: not given */
	bool check;
};

static void print_usage(FILE *out)
{
	(void)fputs(
		"usage: drivebridge-opcua [--config FILE] [--check]\n"
		"       drivebridge-opcua [--config FILE] --add-user NAME --role reader|operator\n"
		"       drivebridge-opcua [--config FILE] --remove-user NAME\n"
		"  --config FILE       what to serve to whom; " CONFIG_PATH " when not given\n"
		"  --check             check the file and the users, and end\n"
		"  --add-user NAME     make a user, or give one another password and role;\n"
		"                      the password is asked for, or a line of standard input\n"
		"  --remove-user NAME  take a user away\n"
		"  --help, --version\n",
		out);
}

/* -1 to go on, else the status to exit with. */
static int read_options(int argc, char **argv, struct options *options)
{
	static const struct option known[] = {
		{ "config", required_argument, NULL, 'c' },
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

	while ((option = getopt_long(argc, argv, "", known, NULL)) != -1) {
		if (option == 'c') {
			options->config = optarg;
		} else if (option == 'k') {
			options->check = true;
		} else if (option == 'a') {
			options->add = optarg;
		} else if (option == 'r') {
			options->remove = optarg;
		} else if (option == 'o') {
			good = good && db_role_read(optarg, &options->role);
		} else if (option == 'v') {
			(void)puts("drivebridge-opcua " DB_VERSION);
			return EXIT_SUCCESS;
		} else {
			print_usage(option == 'h' ? stdout : stderr);
			return option == 'h' ? EXIT_SUCCESS : 2;
		}
	}
	/* A role is for who is added, and nobody is added without. */
	good = good && optind == argc && !(options->add && options->remove) &&
	       (options->role != DB_ROLE_NONE) == (options->add != NULL);
	if (good)
		return -1;
	print_usage(stderr);
	return 2;
}

static db_time read_clock(void)
{
	struct timespec time;

	(void)clock_gettime(CLOCK_MONOTONIC, &time);
	return (db_time)time.tv_sec * DB_NS_PER_S + time.tv_nsec;
}

static int64_t read_calendar(void)
{
	struct timespec time;

	(void)clock_gettime(CLOCK_REALTIME, &time);
	return (int64_t)time.tv_sec * 1000000 + time.tv_nsec / 1000;
}

/* Until a signal ends it. */
static int run(struct db_opcua_server *server, int signals)
{
	size_t places = db_opcua_server_places(server) + 1;
	struct pollfd *fds = calloc(places, sizeof(*fds));

	if (!fds)
		return EXIT_FAILURE;
	(void)sd_notify(0, "READY=1");
	for (;;) {
		db_time now = read_clock();
		db_time wait = db_opcua_server_due(server, now) - now;
		struct timespec patience;
		size_t used;

		wait = wait < 0 ? 0 : wait > TURN_MAX ? TURN_MAX : wait;
		patience = (struct timespec){ .tv_sec = wait / DB_NS_PER_S,
			                      .tv_nsec = wait % DB_NS_PER_S };
		fds[0] = (struct pollfd){ .fd = signals, .events = POLLIN };
		used = db_opcua_server_watch(server, fds + 1, places - 1);
		if (ppoll(fds, used + 1, &patience, NULL) < 0 && errno != EINTR)
			break;
		if (fds[0].revents != 0)
			break;
		db_opcua_server_handle(server, read_clock(), read_calendar());
		(void)sd_notify(0, "WATCHDOG=1");
	}
	(void)sd_notify(0, "STOPPING=1");
	free(fds);
	return EXIT_SUCCESS;
}

static int check(const struct options *options, const struct db_opcua_config *config)
{
	struct db_users users;
	bool good = db_users_load(&users, config->users, &db_opcua_keeper, stderr);

	if (good)
		(void)printf("%s: it is good; %zu users\n", options->config, users.count);
	db_users_clear(&users);
	return good ? EXIT_SUCCESS : EXIT_CONFIG;
}

static int open_signals(void)
{
	sigset_t set;

	(void)sigemptyset(&set);
	(void)sigaddset(&set, SIGTERM);
	(void)sigaddset(&set, SIGINT);
	(void)sigprocmask(SIG_BLOCK, &set, NULL);
	return signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
}

int main(int argc, char **argv)
{
	struct options options = { .config = CONFIG_PATH };
	struct db_opcua_server *server;
	struct db_opcua_config config;
	char host[64] = "gateway";
	int status = read_options(argc, argv, &options);
	int signals;

	if (status >= 0)
		return status;
	(void)gethostname(host, sizeof(host) - 1);
	if (!db_opcua_config_load(options.config, host, stderr, &config)) {
		db_opcua_config_free(&config);
		return EXIT_CONFIG;
	}
	if (options.check || options.add || options.remove) {
		status = options.check ?
		                 check(&options, &config) :
		                 db_users_administer(&db_opcua_keeper, config.users, options.add,
		                                     options.remove, options.role);
		db_opcua_config_free(&config);
		return status;
	}
	(void)signal(SIGPIPE, SIG_IGN);
	signals = open_signals();
	srand((unsigned)(read_calendar() ^ getpid()));
	server = signals >= 0 ? db_opcua_server_new(&config) : NULL;
	status = server ? run(server, signals) : EXIT_FAILURE;
	db_opcua_server_free(server);
	db_opcua_config_free(&config);
	if (signals >= 0)
		(void)close(signals);
	return status;
}
