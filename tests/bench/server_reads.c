/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Requests per second of 100 registers with several clients: this server, a bare epoll server that
 * only copies registers, and a plain libmodbus select server, one after the other in the same run.
 *
 *   server_reads [SECONDS [CLIENTS [ROUNDS [PORT UNIT ADDRESS]]]]
 *
 * With a port, "drivebridge" is a drivebridged that runs there, and its registers are read.
 *
 * Each server is a process of its own; all clients share another one. The figure of a server is the
 * best of its rounds, because everything that disturbs a measurement makes it smaller. Beside it is the
 * processor time that a request took of that server, in the program and in the kernel.
 */
#include "drivebridge/server.h"

#include <arpa/inet.h>
#include <modbus.h>
#include <netinet/tcp.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <sys/select.h>
#include <sys/wait.h>
#include <systemd/sd-event.h>
#include <time.h>
#include <unistd.h>

#define REGISTERS 100
#define ANSWER (9 + 2 * REGISTERS)
#define CLIENTS_MAX 256

static _Noreturn void fail(const char *what)
{
	perror(what);
	exit(EXIT_FAILURE);
}

static double seconds(void)
{
	struct timespec t;

	clock_gettime(CLOCK_MONOTONIC, &t);
	return (double)t.tv_sec + (double)t.tv_nsec / 1e9;
}

/* This server. */

static uint8_t any_unit(void *context, const struct db_client *client, uint8_t unit)
{
	(void)client;
	(void)context;
	(void)unit;
	return 0;
}

static uint8_t copy_registers(void *context, const struct db_client *client, uint8_t unit,
                              enum db_table table, uint16_t address, uint16_t count,
                              uint16_t *values)
{
	(void)client;
	(void)unit;
	(void)table;
	(void)address;
	memcpy(values, context, count * sizeof(*values));
	return 0;
}

/* Tells the port to the parent. */
static void report(int pipe, uint16_t port)
{
	if (write(pipe, &port, sizeof(port)) != sizeof(port))
		fail("pipe");
}

static _Noreturn void serve_ours(int pipe)
{
	static const struct db_backend backend = { .unit = any_unit, .read = copy_registers };
	static const struct db_log_source quiet = { 0 };
	static uint16_t registers[2000];
	char listen_address[] = "127.0.0.1:0";
	const struct db_modbus_config config = {
		.listen = listen_address,
		.max_clients = CLIENTS_MAX,
		.max_pipelined = 16,
		.frame_timeout_ms = 1000,
	};
	struct db_server *server;
	const char *where;
	sd_event *loop;

	if (sd_event_new(&loop) < 0 ||
	    db_server_new(loop, &config, &backend, registers, &quiet, &server, &where) < 0)
		fail("server");
	report(pipe, db_server_port(server, DB_ENDPOINT_FIRST));
	(void)sd_event_loop(loop);
	exit(EXIT_FAILURE);
}

/* The two peers. */

static int open_listener(uint16_t *port)
{
	struct sockaddr_in address = { .sin_family = AF_INET };
	socklen_t length = sizeof(address);
	int fd = socket(AF_INET, SOCK_STREAM, 0);

	address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
	if (fd < 0 || bind(fd, (struct sockaddr *)&address, length) < 0 || listen(fd, 64) < 0 ||
	    getsockname(fd, (struct sockaddr *)&address, &length) < 0)
		fail("listen");
	*port = ntohs(address.sin_port);
	return fd;
}

static bool answer_bare(int fd, const uint16_t *registers)
{
	uint8_t in[260], out[260];
	ssize_t got = recv(fd, in, sizeof(in), 0);
	uint16_t count;

	if (got < 12)
		return false;
	count = (uint16_t)(in[10] << 8 | in[11]);
	if (count > 125)
		return false;
	memcpy(out, in, 8);
	out[4] = 0;
	out[5] = (uint8_t)(3 + 2 * count);
	out[8] = (uint8_t)(2 * count);
	for (size_t i = 0; i < count; i++) {
		out[9 + 2 * i] = (uint8_t)(registers[i] >> 8);
		out[10 + 2 * i] = (uint8_t)registers[i];
	}
	return send(fd, out, 9 + 2 * (size_t)count, MSG_NOSIGNAL) > 0;
}

static _Noreturn void serve_bare(int pipe)
{
	static uint16_t registers[125];
	struct epoll_event events[64], event = { .events = EPOLLIN };
	const int on = 1;
	uint16_t port;
	int listener = open_listener(&port), set = epoll_create1(0), count, fd;

	event.data.fd = listener;
	epoll_ctl(set, EPOLL_CTL_ADD, listener, &event);
	report(pipe, port);
	for (;;) {
		count = epoll_wait(set, events, 64, -1);
		for (int i = 0; i < count; i++) {
			fd = events[i].data.fd;
			if (fd == listener) {
				event.data.fd = accept(listener, NULL, NULL);
				setsockopt(event.data.fd, IPPROTO_TCP, TCP_NODELAY, &on,
				           sizeof(on));
				epoll_ctl(set, EPOLL_CTL_ADD, event.data.fd, &event);
			} else if (!answer_bare(fd, registers)) {
				close(fd);
			}
		}
	}
}

static void answer_libmodbus(modbus_t *modbus, modbus_mapping_t *mapping, int fd, fd_set *all)
{
	uint8_t query[MODBUS_TCP_MAX_ADU_LENGTH];
	int length;

	modbus_set_socket(modbus, fd);
	length = modbus_receive(modbus, query);
	if (length > 0) {
		modbus_reply(modbus, query, length, mapping);
	} else if (length < 0) {
		close(fd);
		FD_CLR(fd, all);
	}
}

static _Noreturn void serve_libmodbus(int pipe)
{
	modbus_t *modbus = modbus_new_tcp("127.0.0.1", 0);
	modbus_mapping_t *mapping = modbus_mapping_new(1, 1, 2000, 1);
	const int on = 1;
	uint16_t port;
	int listener = open_listener(&port), highest = listener, client;
	fd_set all, ready;

	FD_ZERO(&all);
	FD_SET(listener, &all);
	report(pipe, port);
	for (;;) {
		ready = all;
		if (select(highest + 1, &ready, NULL, NULL, NULL) < 0)
			fail("select");
		for (int fd = 0; fd <= highest; fd++) {
			if (!FD_ISSET(fd, &ready))
				continue;
			if (fd != listener) {
				answer_libmodbus(modbus, mapping, fd, &all);
				continue;
			}
			client = accept(listener, NULL, NULL);
			setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
			FD_SET(client, &all);
			highest = client > highest ? client : highest;
		}
	}
}

/* The clients: each has one request under way. */

static void ask(int fd, uint8_t unit, uint16_t first)
{
	const uint8_t request[] = {
		0, 1, 0, 0, 0, 6, unit, 3, (uint8_t)(first >> 8), (uint8_t)first, 0, REGISTERS
	};

	if (send(fd, request, sizeof(request), MSG_NOSIGNAL) != sizeof(request))
		fail("send");
}

static int open_client(uint16_t port)
{
	struct sockaddr_in address = { .sin_family = AF_INET, .sin_port = htons(port) };
	const int on = 1;
	int fd = socket(AF_INET, SOCK_STREAM, 0);

	address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
	if (fd < 0 || connect(fd, (struct sockaddr *)&address, sizeof(address)) < 0)
		fail("connect");
	setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
	return fd;
}

static double drive(uint16_t port, int clients, double duration, uint8_t unit, uint16_t first)
{
	struct epoll_event events[64], event = { .events = EPOLLIN };
	int set = epoll_create1(0), fds[CLIENTS_MAX], count;
	size_t got[CLIENTS_MAX] = { 0 };
	double begin = seconds(), now = begin;
	uint8_t answer[4096];
	uint64_t done = 0;
	ssize_t length;

	for (int i = 0; i < clients; i++) {
		fds[i] = open_client(port);
		event.data.u32 = (uint32_t)i;
		epoll_ctl(set, EPOLL_CTL_ADD, fds[i], &event);
		ask(fds[i], unit, first);
	}
	for (; now - begin < duration; now = seconds()) {
		count = epoll_wait(set, events, 64, 1000);
		for (int i = 0; i < count; i++) {
			uint32_t client = events[i].data.u32;

			length = recv(fds[client], answer, sizeof(answer), 0);
			if (length <= 0)
				fail("recv");
			if (got[client] == 0 && length > 7 && (answer[7] & 0x80)) {
				fprintf(stderr, "exception %u\n", answer[8]);
				exit(EXIT_FAILURE);
			}
			got[client] += (size_t)length;
			if (got[client] < ANSWER)
				continue;
			got[client] = 0;
			done++;
			ask(fds[client], unit, first);
		}
	}
	for (int i = 0; i < clients; i++)
		close(fds[i]);
	close(set);
	return (double)done / (now - begin);
}

static const struct contender {
	const char *name;
	void (*serve)(int pipe);
} CONTENDERS[] = {
	{ "drivebridge", serve_ours },
	{ "bare epoll", serve_bare },
	{ "libmodbus select", serve_libmodbus },
};

/* What a server did in its time. */
struct measured {
	double rate;   /* requests per second */
	double user;   /* processor time of a request, in the program ... */
	double system; /* ... and in the kernel for it, in microseconds */
};

static double in_us(const struct timeval *time)
{
	return (double)time->tv_sec * 1e6 + (double)time->tv_usec;
}

static struct measured measure(const struct contender *contender, int clients, double duration)
{
	struct rusage used;
	int pipes[2];
	uint16_t port;
	double rate;
	pid_t child;

	if (pipe(pipes) < 0)
		fail("pipe");
	child = fork();
	if (child < 0)
		fail("fork");
	if (child == 0)
		contender->serve(pipes[1]);
	if (read(pipes[0], &port, sizeof(port)) != sizeof(port))
		fail("server");
	rate = drive(port, clients, duration, 1, 0);
	kill(child, SIGKILL);
	if (wait4(child, NULL, 0, &used) < 0)
		fail("wait4");
	close(pipes[0]);
	close(pipes[1]);
	return (struct measured){ rate, in_us(&used.ru_utime) / (rate * duration),
		                  in_us(&used.ru_stime) / (rate * duration) };
}

int main(int argc, char **argv)
{
	double duration = argc > 1 ? atof(argv[1]) : 1.0;
	struct measured best[3] = { { 0 } }, now;
	int clients = argc > 2 ? atoi(argv[2]) : 8;
	int rounds = argc > 3 ? atoi(argv[3]) : 3;
	uint16_t port = argc > 6 ? (uint16_t)atoi(argv[4]) : 0;
	uint8_t unit = argc > 6 ? (uint8_t)atoi(argv[5]) : 1;
	uint16_t first = argc > 6 ? (uint16_t)atoi(argv[6]) : 0;

	if (duration <= 0 || clients < 1 || clients > CLIENTS_MAX || rounds < 1) {
		fprintf(stderr, "usage: %s [SECONDS [CLIENTS [ROUNDS [PORT UNIT ADDRESS]]]]\n",
		        argv[0]);
		return EXIT_FAILURE;
	}
	for (int round = 0; round < rounds; round++) {
		for (int i = 0; i < 3; i++) {
			if (i == 0 && port)
				now = (struct measured){ .rate = drive(port, clients, duration,
					                               unit, first) };
			else
				now = measure(&CONTENDERS[i], clients, duration);
			best[i] = now.rate > best[i].rate ? now : best[i];
		}
	}
	for (int i = 0; i < 3; i++)
		printf("%-18s %9.0f requests/s  %5.2f of bare epoll  %5.2f of libmodbus  "
		       "%5.2f us user  %5.2f us system\n",
		       CONTENDERS[i].name, best[i].rate, best[i].rate / best[1].rate,
		       best[i].rate / best[2].rate, best[i].user, best[i].system);
	return EXIT_SUCCESS;
}
