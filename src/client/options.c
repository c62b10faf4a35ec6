/* SPDX-License-Identifier: Apache-2.0 */
#include "client/options.h"

#include "drivebridge/version.h"

#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>

enum { HELP = DB_CLIENT_OPTIONS_MAX, VERSION, KNOWN };

int db_client_options_read(const char *program, const char *usage,
                           const struct db_client_option *options, int argc, char **argv)
{
	struct option known[KNOWN + 1] = {
		{ "help", no_argument, NULL, HELP },
		{ "version", no_argument, NULL, VERSION },
	};
	int option;

	for (int i = 0; i < DB_CLIENT_OPTIONS_MAX && options[i].name; i++)
		known[2 + i] = (struct option){
			.name = options[i].name,
			.has_arg = options[i].text ? required_argument : no_argument,
			.val = i,
		};
	while ((option = getopt_long(argc, argv, "", known, NULL)) != -1) {
		if (option == HELP) {
			(void)fputs(usage, stdout);
			return EXIT_SUCCESS;
		}
		if (option == VERSION) {
			(void)printf("%s %s\n", program, DB_VERSION);
			return EXIT_SUCCESS;
		}
		if (option == '?') {
			(void)fputs(usage, stderr);
			return DB_CLIENT_EXIT_USAGE;
		}
		if (options[option].text)
			*options[option].text = optarg;
		else
			*options[option].flag = true;
	}
	if (optind == argc)
		return -1;
	(void)fputs(usage, stderr);
	return DB_CLIENT_EXIT_USAGE;
}
