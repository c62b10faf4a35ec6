/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridged: the command line.
 */
#include "drivebridge/config.h"
#include "drivebridge/version.h"
#include "service/service.h"

#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>

#define PACKAGED_CONFIG "/etc/drivebridge/drivebridge.conf"

struct options {
	const char *config;
	bool check;
	bool no_last_good;
};

static void usage(FILE *out)
{
	fputs("usage: drivebridged [--config FILE] [--check] [--no-last-good]\n"
	      "  --config FILE  run in the foreground with this configuration;\n"
	      "                 " PACKAGED_CONFIG " when not given\n"
	      "  --check        read the file, say what would run or what is wrong, and end\n"
	      "  --no-last-good end when the file is wrong, instead of running with the last good "
	      "one\n"
	      "  --version      print the version\n"
	      "  --help         print this\n",
	      out);
}

/* -1 to go on, else the status to exit with. */
static int read_options(int argc, char **argv, struct options *options)
{
	static const struct option known[] = {
		{ "config", required_argument, NULL, 'c' }, { "check", no_argument, NULL, 'k' },
		{ "no-last-good", no_argument, NULL, 'n' }, { "version", no_argument, NULL, 'v' },
		{ "help", no_argument, NULL, 'h' },         { NULL, 0, NULL, 0 },
	};
	int option;

	while ((option = getopt_long(argc, argv, "c:h", known, NULL)) != -1) {
		switch (option) {
		case 'c':
			options->config = optarg;
			break;
		case 'k':
			options->check = true;
			break;
		case 'n':
			options->no_last_good = true;
			break;
		case 'v':
			puts("drivebridged " DB_VERSION);
			return EXIT_SUCCESS;
		case 'h':
			usage(stdout);
			return EXIT_SUCCESS;
		default:
			usage(stderr);
			return 2;
		}
	}
	if (optind != argc) {
		usage(stderr);
		return 2;
	}
	return -1;
}

static int check(const char *path)
{
	struct db_config *config = NULL;

	if (db_config_load(path, stderr, &config) != 0)
		return EXIT_FAILURE;
	db_config_describe(config, stdout);
	db_config_probe(config, stdout, stderr);
	puts("every value, as a file would say it");
	db_config_write(config, stdout);
	db_config_free(config);
	return EXIT_SUCCESS;
}

int main(int argc, char **argv)
{
	struct options options = { .config = PACKAGED_CONFIG };
	int status = read_options(argc, argv, &options);

	if (status >= 0)
		return status;
	return options.check ? check(options.config) :
	                       db_service_run(options.config, !options.no_last_good);
}
