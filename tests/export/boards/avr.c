/* An AVR under simavr: printf goes to the UART, main's end stops the processor. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <stdio.h>

static int put(char c, FILE *stream)
{
    (void)stream;
    while (!(UCSR0A & (1 << UDRE0)))
    {
    }
    UDR0 = (unsigned char)c;
    return 0;
}

static FILE serial = FDEV_SETUP_STREAM(put, NULL, _FDEV_SETUP_WRITE);

__attribute__((constructor)) static void begin(void)
{
    UCSR0B = 1 << TXEN0;
    stdout = &serial;
}

__attribute__((destructor)) static void end(void)
{
    unsigned int wait;
    for (wait = 0; wait < 60000U; wait++)
    {
        __asm__ volatile("nop");
    }
    cli();
    sleep_enable();
    sleep_cpu();
}
