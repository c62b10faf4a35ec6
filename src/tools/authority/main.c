/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridge-certificate: an authority, certificates of the gateway and of clients with roles, and
 * their revocation, each by one command: what `drivebridgectl certificate` runs.
 */
#include "authority/authority.h"
#include "codec/secure_hello.h"
#include "drivebridge/version.h"

#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#define FOLDER "/etc/drivebridge/tls"
#define DAY ((int64_t)24 * 3600)
#define DAYS_MAX 36500
/* An authority outlives what it signs; what it signs is renewed every two years. */
#define DAYS_OF_AUTHORITY 7305
#define DAYS 825
#define EXIT_USAGE 2

static const char usage[] =
	"usage: drivebridge-certificate [--folder FOLDER] [--days N] authority [NAME]\n"
	"       drivebridge-certificate [...] server NAME [HOST...]\n"
	"       drivebridge-certificate [...] client NAME [ROLE]\n"
	"       drivebridge-certificate [--folder FOLDER] revoke NAME\n"
	"  authority        make an authority that signs the others: authority.pem\n"
	"  server           the gateway's own certificate: server.pem; HOST: a name or address by\n"
	"                   which clients connect to it\n"
	"  client           a client's certificate with its role: NAME.pem, NAME-key.pem\n"
	"  revoke           take a client's certificate back: revoked.pem\n"
	"  --folder FOLDER  where they are; " FOLDER " when not given\n"
	"  --days N         how long it is valid; 825, the authority's 7305 when not given\n"
	"  --help, --version\n";

/* The words behind the options, and what the request says without them. */
struct task {
	const char *word;
	int min; /* numbers of words behind it */
	int max;
	int64_t days; /* 0: it has no end of its own */
	bool (*carry_out)(const struct db_authority_request *request);
};

static const struct task tasks[] = {
	{ "authority", 0, 1, DAYS_OF_AUTHORITY, db_authority_make },
	{ "server", 1, 1 + DB_AUTHORITY_HOSTS_MAX, DAYS, db_authority_make_server },
	{ "client", 1, 2, DAYS, db_authority_make_client },
	{ "revoke", 1, 1, 0, db_authority_revoke },
};

static int complain(const char *why)
{
	fprintf(stderr, "%s\n", why);
	return EXIT_USAGE;
}

/* -1: all is well; else the reason is printed. */
static int read_words(const struct task *task, struct db_authority_request *request, int count,
                      char **words)
{
	if (count > 0)
		request->name = words[0];
	if (strlen(request->name) == 0 || strlen(request->name) > 64)
		return complain("a name has 1 to 64 characters");
	if (task->carry_out == db_authority_make_server) {
		/* Its name is one of those by which it is found. */
		request->hosts = (const char *const *)words;
		request->host_count = (size_t)count;
	} else if (task->carry_out != db_authority_make && !db_authority_is_name(request->name)) {
		return complain("a client's name has 1 to 64 of A-Z a-z 0-9 . _ -, does not begin "
		                "with . or -, and is not authority, server or revoked");
	}
	if (task->carry_out == db_authority_make_client && count == 2) {
		request->role = words[1];
		if (!db_secure_role_is_good(request->role))
			return complain("a role has 1 to 32 visible characters, no spaces");
	}
	return -1;
}

static void say_what_next(const struct task *task, const struct db_authority_request *request)
{
	if (task->carry_out == db_authority_make_client)
		printf("%s/%s.pem and %s-key.pem are for the client, with authority.pem; "
		       "delete the key here when it has it\n",
		       request->folder, request->name, request->name);
	else if (task->carry_out == db_authority_revoke)
		printf("%s is revoked in %s/revoked.pem, which crl-file in tls.conf has to "
		       "name; now: systemctl reload drivebridge-tls\n",
		       request->name, request->folder);
	else if (task->carry_out == db_authority_make_server)
		printf("%s/server.pem is made; systemctl reload drivebridge-tls takes it "
		       "over\n",
		       request->folder);
	else
		printf("%s/authority-key.pem signs whoever may command drives: only root "
		       "must be able to read it\n",
		       request->folder);
}

int main(int argc, char **argv)
{
	const struct option known[] = {
		{ "folder", required_argument, NULL, 'f' },
		{ "days", required_argument, NULL, 'd' },
		{ "help", no_argument, NULL, 'h' },
		{ "version", no_argument, NULL, 'v' },
		{ NULL, 0, NULL, 0 },
	};
	struct db_authority_request request = { .folder = FOLDER };
	const struct task *task = NULL;
	char name[80] = "drivebridge authority";
	long days = 0;
	int option;
	int status;

	while ((option = getopt_long(argc, argv, "", known, NULL)) != -1) {
		switch (option) {
		case 'f':
			request.folder = optarg;
			break;
		case 'd':
			days = strtol(optarg, NULL, 10);
			if (days < 1 || days > DAYS_MAX)
				return complain("--days takes 1 to 36500");
			break;
		case 'h':
			fputs(usage, stdout);
			return EXIT_SUCCESS;
		case 'v':
			puts("drivebridge-certificate " DB_VERSION);
			return EXIT_SUCCESS;
		default:
			fputs(usage, stderr);
			return EXIT_USAGE;
		}
	}
	for (size_t i = 0; optind < argc && i < sizeof(tasks) / sizeof(tasks[0]); i++) {
		if (strcmp(tasks[i].word, argv[optind]) == 0)
			task = &tasks[i];
	}
	if (!task || argc - optind - 1 < task->min || argc - optind - 1 > task->max) {
		fputs(usage, stderr);
		return EXIT_USAGE;
	}
	request.name = name;
	/* Clients' clocks may be late. */
	request.begins = (int64_t)time(NULL) - (task->days > 0 ? DAY : 0);
	request.ends = request.begins + (days > 0 ? days : task->days) * DAY;
	status = read_words(task, &request, argc - optind - 1, argv + optind + 1);
	if (status >= 0)
		return status;
	/* The folder is for everybody to enter; each file has its own rights. */
	(void)umask(022);
	if (!task->carry_out(&request))
		return EXIT_FAILURE;
	say_what_next(task, &request);
	return fflush(stdout) == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
